//! `sevenbot serve` and `sevenbot view`: one arm for many programs.

mod attacks;
mod bad_web;
mod load;
mod served;
mod sharing;
mod view;
mod web;
