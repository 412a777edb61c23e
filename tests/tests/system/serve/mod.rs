//! `sevenbot serve`, `sevenbot view` and `sevenbot class`: one arm for many programs.

mod attacks;
mod bad_web;
mod chaos;
mod class;
mod class_tabs;
mod descriptors;
mod line_history;
mod load;
mod network;
mod rates;
mod served;
mod sharing;
mod stops;
mod view;
mod web;
