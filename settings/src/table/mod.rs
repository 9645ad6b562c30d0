//! The tables of a scenario file.
//!
//! | module | holds |
//! |---|---|
//! | [`run`] | the whole scenario, `[run]`, `[bounds]` |
//! | [`timing`] | `[realtime]`, `[deadline]` |
//! | [`mission`] | `[mission]`, `[initial]` |
//! | [`part`] | `[mission.limits]`, `[[mission.part]]` |
//! | [`vehicle`] | `[plant]`; `[airframe]` is [`airframe::Parameters`] |
//! | [`sensors`] | `[plant.sensors]` |
//! | [`control`] | `[guidance]`, `[attitude]`, `[mixer]` |
//! | [`fault`] | `[[fault]]` |
//! | [`swap`] | `[[swap]]` |
//! | [`program`] | `[node.NAME]` |
//! | [`profile`] | every default |

pub mod control;
pub mod fault;
pub mod mission;
pub mod part;
pub mod profile;
pub mod program;
pub mod run;
pub mod sensors;
pub mod swap;
pub mod timing;
pub mod vehicle;
