//! Draws: pages, pictures and tables of flights, from their messages and [outcomes](outcome).
//!
//! | module | holds |
//! |---|---|
//! | [`comparison`] | several flights side by side |
//! | [`differing_settings`] | settings that differ between flights |
//! | [`explain`] | the costs of late, lost and missing messages |
//! | [`table`] | tables as aligned text and as HTML |
//! | [`targets`] | verdicts on targets as a table |
//! | [`cells`] | tables of data: their cells, and their columns in Parquet |
//! | [`cycle`] | times of one cycle of a node |
//! | [`thinning`] | long series reduced to what a picture can show |
//! | [`draw`] | HTML and pictures, for every page |
//! | [`report`] | `report.html` |
//! | [`export`] | a run in the formats of other tools |
//! | [`scene`] | a flight in the schemas of viewers that show a vehicle |

#![allow(missing_docs)]

pub mod cells;
pub mod comparison;
pub mod cycle;
pub mod differing_settings;
pub mod draw;
pub mod explain;
pub mod export;
pub mod report;
pub mod scene;
pub mod table;
pub mod targets;
pub mod thinning;
