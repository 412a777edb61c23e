//! The page that simulates, shows and drives a 7Bot V2 arm in a browser.

#![forbid(unsafe_code)]

pub mod plots;
pub mod scene;
