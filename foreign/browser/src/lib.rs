//! The shipped survey for a page: the ring in one thread ([`ring`]), compiled to WebAssembly. The page is in `page/`.
//!
//! | module | holds |
//! |---|---|
//! | [`flight`] | a flight, from settings to JSON |
//! | `exports` | the functions that the page calls |
//!
//! The module imports nothing: it can read neither a clock nor anything else of the page.

mod exports;
pub mod flight;
