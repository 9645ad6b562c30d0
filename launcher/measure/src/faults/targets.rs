//! The promises, and what became of them.

use contract::scenario::Mode;

use super::Results;
use super::case::Promise;
use super::one_flight::{BACK_M, Row, TERMINATE_S, TILT_DEG};
use super::relay::Relay;
use super::strike::Strike;
use crate::Target;

/// Farthest from the trajectory that good candidates may take the vehicle \[m\].
const SWAP_M: f64 = 0.1;

/// One line each.
pub fn targets(results: &Results) -> Vec<Target> {
    let mut targets = of_the_matrix(&results.rows);
    targets.extend(of_the_paper(&results.paper));
    let alarms: u64 = results.quiet.iter().map(|quiet| quiet.flagged + quiet.refused + quiet.events).sum();
    targets.push(Target::at_most("false alarms in 60 quiet seconds, two flights", Some(alarms as f64), 0.0, ""));
    targets.extend(results.relays.iter().flat_map(of_a_relay));
    targets.extend(in_real_time(results));
    targets
}

fn of_the_matrix(rows: &[Row]) -> Vec<Target> {
    let those = |promise| rows.iter().filter(move |row| row.promise == promise);
    let recoverable = those(Promise::Recover).count();
    let broken = |fails: fn(&Row) -> bool| {
        let names: Vec<&str> = those(Promise::Recover).filter(|row| fails(row)).map(|row| row.fault.as_str()).collect();
        names.join(", ")
    };
    let worst = |of: fn(&Row) -> f64| those(Promise::Recover).map(of).reduce(f64::max);
    let tilt = |row: &Row| row.course.tilt_deg;
    let back = |row: &Row| row.course.back_m.unwrap_or(f64::INFINITY);
    let silent = rows.iter().find(|row| row.fault == "attitude-mpc kill").map(tilt);
    let terminated = |row: &Row| row.course.terminated_after_s.unwrap_or(f64::INFINITY);
    let different: Vec<&str> = rows.iter().filter(|row| !row.same).map(|row| row.fault.as_str()).collect();
    vec![
        Target::at_most(format!("worst tilt in {recoverable} recoverable faults"), worst(tilt), TILT_DEG, "deg")
            .noting(broken(|row| row.course.tilt_deg > TILT_DEG)),
        Target::at_most("worst tilt, 1 s without attitude-mpc in gusts", silent, TILT_DEG, "deg"),
        Target::at_most(format!("farthest 5 s after {recoverable} recoverable faults"), worst(back), BACK_M, "m")
            .noting(broken(|row| row.course.back_m.is_none_or(|back_m| back_m > BACK_M))),
        Target::at_most(
            "dead rotor, until the flight is terminated",
            those(Promise::Terminate).map(terminated).reduce(f64::max),
            TERMINATE_S,
            "s",
        ),
        Target::at_most(
            format!("flights of {} that differ between lockstep and one thread", rows.len()),
            Some(different.len() as f64),
            0.0,
            "",
        )
        .noting(different.join(", ")),
    ]
}

fn of_the_paper(rows: &[Row]) -> Option<Target> {
    let short: Vec<&str> =
        rows.iter().filter(|row| row.kept() == Some(false) || !row.same).map(|row| row.fault.as_str()).collect();
    let figure = format!("profile paper in calm, {} faults: promises broken", rows.len());
    let target = Target::at_most(figure, Some(short.len() as f64), 0.0, "").noting(short.join(", "));
    (!rows.is_empty()).then_some(target)
}

fn of_a_relay(relay: &Relay) -> Vec<Target> {
    let mode = match relay.mode {
        Mode::Realtime => "real time",
        _ => "lockstep",
    };
    let Relay { swaps, kept, tilt_deg, position_error_m, lost_ticks, explained, .. } = *relay;
    let Relay { rejected, returned, .. } = relay;
    let sent_away = || rejected.iter().chain(returned).map(String::as_str).collect::<Vec<_>>().join("; ");
    let count = |figure: String, count: usize| Target::at_most(figure, Some(count as f64), 0.0, "");
    let mut targets = if relay.good {
        let explains = if explained > 0 { format!("the canary explains {explained} more") } else { String::new() };
        vec![
            count(format!("{mode}, {swaps} good candidates: not kept"), swaps - kept).noting(sent_away()),
            count(format!("{mode}, {swaps} good candidates: ticks lost"), lost_ticks - explained).noting(explains),
            Target::at_most(format!("{mode}, {swaps} good candidates: error"), Some(position_error_m), SWAP_M, "m"),
        ]
    } else {
        let tilt_deg = if relay.lost { f64::INFINITY } else { tilt_deg };
        vec![
            count(format!("{mode}, {swaps} wrong candidates: kept"), kept).noting(format!(
                "{} sent away from the standby, {} from role",
                rejected.len(),
                returned.len()
            )),
            Target::at_most(format!("{mode}, {swaps} wrong candidates: worst tilt"), Some(tilt_deg), TILT_DEG, "deg"),
        ]
    };
    targets.extend(relay.same.map(|same| {
        let sort = if relay.good { "good" } else { "wrong" };
        count(format!("flight with {swaps} {sort} candidates, other by one thread"), usize::from(!same))
    }));
    targets
}

fn in_real_time(results: &Results) -> Vec<Target> {
    let strikes = &results.strikes;
    let target = |figure: &str, strikes: &[Strike], of: fn(&Strike) -> Option<f64>, limit_ms: f64| {
        let target = Target::at_most(format!("{figure}, median"), median(strikes, of), limit_ms, "ms");
        match &results.strikes.canary.doubt {
            Some(why) => target.in_doubt(why.as_str()),
            None => target,
        }
    };
    let mut targets = vec![
        target("crash noticed", &strikes.kills, |strike| strike.noticed_ms, 5.0),
        target("hang noticed", &strikes.hangs, |strike| strike.noticed_ms, 30.0),
        target("hang, until a command without attitude-mpc", &strikes.hangs, |strike| strike.fallback_ms, 30.0),
        target("crash, until the restarted node's first message", &strikes.kills, |strike| strike.restarted_ms, 150.0),
    ];
    // A strike without effect is no slow one.
    let missing = strikes.kills.iter().chain(&strikes.hangs).filter(|s| s.restarted_ms.is_none()).count();
    targets.push(Target::at_most("strikes that nobody came back from", Some(missing as f64), 0.0, ""));
    targets
}

/// The one in the middle, of those that have one.
pub fn median(strikes: &[Strike], of: fn(&Strike) -> Option<f64>) -> Option<f64> {
    let mut times: Vec<f64> = strikes.iter().filter_map(of).collect();
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied()
}
