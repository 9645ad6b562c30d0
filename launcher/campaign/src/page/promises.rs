//! Verdicts on the promises of the campaign file.

use outcome::target::{Target, TargetVerdict};
use toml::Value;

use super::data::CampaignPage;
use super::limits;
use crate::file::CASE;
use crate::limit::LIMIT;
use crate::median;
use crate::promise::{Gather, Passed, Promise};
use crate::table::{Cell, cell_of};
use crate::variation::{Factor, Values};

/// Flights that one verdict is about; `None` = all controllers or cases.
struct Group<'a> {
    controller: Option<&'a str>,
    case: Option<&'a str>,
}

/// Returns a verdict for each controller of the promise in each of its cases.
fn targets_of(promise: &Promise, page: &CampaignPage) -> Vec<Target> {
    let each = |names: &'_ [String]| -> Vec<Option<String>> {
        if names.is_empty() { vec![None] } else { names.iter().cloned().map(Some).collect() }
    };
    let mut targets = vec![];
    for case in each(&promise.cases) {
        for controller in each(&promise.controllers) {
            let group = Group { controller: controller.as_deref(), case: case.as_deref() };
            targets.push(target(promise, page, &group));
        }
    }
    targets
}

fn target(promise: &Promise, page: &CampaignPage, group: &Group) -> Target {
    let figure = promise.figure.replace("{controller}", group.controller.unwrap_or("all"));
    let figure = figure.replace("{case}", group.case.unwrap_or("all"));
    let rows = rows_of(promise, page, group);
    let flown = rows.iter().filter(|row| page.passed[**row].is_some()).count();
    let passed = rows.iter().filter(|row| page.passed[**row] == Some(true)).count();
    let is_whole = flown > 0 && flown == rows.len() && flown as u64 == expected(promise, page, group);
    let count = |n: usize| is_whole.then_some(n as f64);
    let target = match (promise.passed, &promise.metric) {
        (Some(Passed::All), _) => {
            Target::when(figure, count(passed), format!("all {flown}"), |passed| passed == flown as f64)
        }
        (Some(Passed::None), _) => {
            Target::when(figure, count(flown - passed), format!("all {flown}"), |lost| lost == flown as f64)
        }
        (Some(Passed::Share), _) => share(promise, page, figure, &rows, is_whole),
        (None, Some(metric)) if metric == LIMIT => limit(promise, page, figure, &rows, is_whole),
        (None, metric) => {
            let value = is_whole.then(|| figure_of(promise, page, metric.as_deref().unwrap_or_default(), group, &rows));
            let unit = promise.unit.clone().unwrap_or_default();
            match (promise.at_most, promise.at_least) {
                (Some(limit), _) => Target::at_most(figure, value, limit, &unit),
                (_, limit) => Target { unit, ..Target::at_least(figure, value, limit.unwrap_or_default()) },
            }
        }
    };
    match (is_whole, rows.is_empty()) {
        (true, _) => {
            let notes = [&*target.note, &*promise.because].map(str::to_owned);
            target.noting(notes.into_iter().filter(|note| !note.is_empty()).collect::<Vec<_>>().join("; "))
        }
        (_, true) => target.noting("not among the flights"),
        _ => target.noting("not all of its flights are there"),
    }
}

/// Judges a promised share of passed flights by its 95 % interval: the promise is kept if the interval lies above the
/// limit, broken if the interval lies below, and else undecided. Without an interval the share itself is judged.
fn share(promise: &Promise, page: &CampaignPage, figure: String, rows: &[usize], is_whole: bool) -> Target {
    let limit = promise.at_least.unwrap_or_default();
    let rate = page.rate_of(rows.iter().copied());
    let measured = is_whole.then_some(rate.share);
    let target = Target::at_least(figure, measured, limit);
    let is_open = rate.draws > 0 && rate.low < limit && rate.high >= limit;
    if is_open && is_whole {
        let verdict = TargetVerdict::Inconclusive;
        return Target { verdict, target: format!("{}, by its interval {}", target.target, rate.interval()), ..target };
    }
    target
}

/// Judges promised limits. A limit beyond an end of the range may have any value there; the verdict is inconclusive if
/// it depends on that value.
fn limit(promise: &Promise, page: &CampaignPage, figure: String, rows: &[usize], is_whole: bool) -> Target {
    let Some(limit) = page.plan.campaign.limit().filter(|_| is_whole) else {
        return Target::at_most(figure, None, promise.at_most.unwrap_or_default(), "");
    };
    let mut limits: Vec<[f64; 2]> = rows.iter().map(|row| limit.between(limits::of(page, limit, *row))).collect();
    limits.sort_by(|one, other| one[0].total_cmp(&other[0]));
    let [least, largest] = match promise.of.unwrap_or_default() {
        Gather::Min => limits[0],
        Gather::Median => limits[median::place(limits.len())],
        _ => limits[limits.len() - 1],
    };
    let (unit, is_known) = (promise.unit.clone().unwrap_or_default(), least == largest);
    let value = if least.is_finite() { least } else { largest };
    let (target, is_kept, is_broken) = match (promise.at_most, promise.at_least.unwrap_or_default()) {
        (Some(most), _) => (Target::at_most(figure, Some(value), most, &unit), largest <= most, least > most),
        (None, bound) => (Target::at_least(figure, Some(value), bound), least >= bound, largest < bound),
    };
    let verdict = match (is_kept, is_broken) {
        (true, _) => TargetVerdict::Ok,
        (_, true) => TargetVerdict::Short,
        _ => TargetVerdict::Inconclusive,
    };
    let target = Target { verdict, unit, ..target };
    target.noting(match () {
        () if is_known => "",
        () if largest.is_infinite() => "or more: the range ends there",
        () => "or less: the range ends there",
    })
}

/// Returns the promised figure: the metric of `rows`; with `over_best` as a multiple of the best controller's.
fn figure_of(promise: &Promise, page: &CampaignPage, metric: &str, group: &Group, rows: &[usize]) -> f64 {
    let own = gathered(promise, page, metric, rows);
    if !promise.over_best || own.is_infinite() {
        return own;
    }
    let of_each = page.names.iter().map(|name| {
        let there = rows_of(promise, page, &Group { controller: Some(name), case: group.case });
        gathered(promise, page, metric, &there)
    });
    own / of_each.filter(|best| best.is_finite()).fold(f64::INFINITY, f64::min)
}

/// Gathers a metric over flights. If one of them failed, the result is infinite on the side that breaks the promise.
fn gathered(promise: &Promise, page: &CampaignPage, metric: &str, rows: &[usize]) -> f64 {
    if rows.iter().any(|row| page.passed[*row] != Some(true)) {
        return if promise.at_least.is_some() { f64::NEG_INFINITY } else { f64::INFINITY };
    }
    let column = page.flights.column(metric);
    let values = || rows.iter().map(|row| column.and_then(|column| column.number(*row)).unwrap_or(f64::NAN));
    match promise.of.unwrap_or_default() {
        _ if values().any(f64::is_nan) => f64::NAN,
        Gather::Max => values().fold(f64::NEG_INFINITY, f64::max),
        Gather::Min => values().fold(f64::INFINITY, f64::min),
        Gather::Median => {
            let mut values: Vec<f64> = values().collect();
            values.sort_by(f64::total_cmp);
            values[median::place(values.len())]
        }
        Gather::Mean => values().sum::<f64>() / rows.len() as f64,
        Gather::Sum => values().sum(),
    }
}

/// Returns the rows of the flights that a verdict is about.
fn rows_of(promise: &Promise, page: &CampaignPage, group: &Group) -> Vec<usize> {
    let is_it = |row: &usize| {
        group.controller.is_none_or(|name| page.names[page.controllers[*row]] == name)
            && group.case.is_none_or(|case| page.flights.column(CASE).is_some_and(|all| all.text(*row) == case))
            && promise
                .at
                .iter()
                .all(|(key, value)| page.flights.column(key).is_some_and(|all| is(&all.cell(*row), value)))
    };
    (0..page.rows()).filter(is_it).collect()
}

/// Returns the number of flights of `group` in a complete campaign.
fn expected(promise: &Promise, page: &CampaignPage, group: &Group) -> u64 {
    let campaign = &page.plan.campaign;
    let controllers = if group.controller.is_some() { 1 } else { page.names.len() as u64 };
    let meant = |factor: &Factor, value: &Value| {
        let is_case = group.case.is_none_or(|case| factor.key != CASE || value.as_str() == Some(case));
        let kind = factor.values.kind();
        is_case && promise.at.get(&factor.key).is_none_or(|wanted| is(&cell_of(kind, value), wanted))
    };
    let values = campaign.factors.iter().map(|factor| match &factor.values {
        Values::Listed(list) => list.iter().filter(|value| meant(factor, value)).count() as u64,
        Values::Drawn(_) => 1,
    });
    values.product::<u64>() * controllers * campaign.samples().unwrap_or(1)
}

/// Returns whether a cell holds `value`, or one of its elements; 1 and 1.0 are equal.
fn is(cell: &Cell, value: &Value) -> bool {
    if let Value::Array(any) = value {
        return any.iter().any(|value| is(cell, value));
    }
    let number = value.as_float().or(value.as_integer().map(|n| n as f64));
    match cell {
        Cell::Int(n) => number == Some(*n as f64),
        Cell::Real(x) => number == Some(*x),
        Cell::Bool(yes) => value.as_bool() == Some(*yes),
        Cell::Text(text) => value.as_str() == Some(text),
        Cell::None => false,
    }
}

/// Returns the section on what the campaign file promises; empty if it promises nothing.
pub fn section(page: &CampaignPage) -> String {
    let targets = targets(page);
    if targets.is_empty() {
        return String::new();
    }
    format!("<section id=\"promises\"><h2>Promises</h2>{}</section>", view::targets::targets(&targets))
}

/// Returns the verdicts on all promises of a campaign, in their order.
pub fn targets(page: &CampaignPage) -> Vec<Target> {
    page.plan.campaign.promises().iter().flat_map(|promise| targets_of(promise, page)).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::shard;
    use crate::table::FlightTable;
    use crate::{Campaign, Plan, row};

    /// Two cases and two masses of a short flight under two controllers, of which `strict` exceeds its bound.
    const CAMPAIGN: &str = "[settings]\nrun.duration_s = 0.5\n[case.calm]\n[case.pushed]\ninitial.velocity_mps = [1.0, 0.0, 0.0]\n\
        [vary]\nplant.airframe.mass_kg = [1.1, 1.15]\n[controller.lax]\nbounds.max_position_error_m = 9.0\n\
        [controller.strict]\nbounds.max_position_error_m = 1e-9\n";

    /// Flies the campaign, without its last `missing` flights; returns the verdicts on `promise`.
    fn verdicts(promise: &str, missing: u64) -> Vec<Target> {
        let text = format!("{CAMPAIGN}[[promise]]\nfigure = \"{{case}} {{controller}}\"\n{promise}");
        let plan = Plan::new(Campaign::read(&text, "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let mut flights = FlightTable::new(&shard::columns_of(&plan));
        for number in 0..plan.flights() - missing {
            let flight = plan.flight(number);
            let outcome = row::fly(&flight, || true, |_| {}).unwrap();
            flights.push([plan.cells(&flight), outcome.cells].concat());
        }
        targets(&CampaignPage::new(&plan, &flights))
    }

    fn told(promise: &str) -> Vec<(String, TargetVerdict)> {
        verdicts(promise, 0).into_iter().map(|target| (target.figure, target.verdict)).collect()
    }

    #[test]
    fn each_controller_in_each_case_has_a_verdict() {
        let all = told("cases = [\"calm\", \"pushed\"]\ncontrollers = [\"lax\", \"strict\"]\npassed = \"all\"");
        let names = ["calm lax", "calm strict", "pushed lax", "pushed strict"];
        let expected = [TargetVerdict::Ok, TargetVerdict::Short, TargetVerdict::Ok, TargetVerdict::Short];
        assert_eq!(all, names.map(str::to_owned).into_iter().zip(expected).collect::<Vec<_>>());
        assert_eq!(told("controllers = [\"strict\"]\npassed = \"none\"")[0].1, TargetVerdict::Ok);
        assert_eq!(told("passed = \"none\"")[0].1, TargetVerdict::Short);
    }

    #[test]
    fn a_failed_flight_breaks_every_promise_on_a_metric() {
        let error = "metric = \"max_position_error_m\"\n";
        let lax = format!("controllers = [\"lax\"]\n{error}");
        assert_eq!(told(&format!("{lax}at_most = 5.0"))[0].1, TargetVerdict::Ok);
        assert_eq!(told(&format!("{lax}at_most = 0.001"))[0].1, TargetVerdict::Short);
        assert_eq!(told(&format!("{error}at_most = 5.0"))[0].1, TargetVerdict::Short, "strict failed");
        for of in ["max", "min", "mean", "sum"] {
            let promised = format!("metric = \"flown_s\"\nof = \"{of}\"\n");
            assert_eq!(told(&format!("{promised}at_least = 0.1"))[0].1, TargetVerdict::Short, "{of}");
            assert_eq!(told(&format!("{promised}at_most = 1e9"))[0].1, TargetVerdict::Short, "{of}");
        }
        let strict = "controllers = [\"strict\"]\nmetric = \"max_position_error_m\"\nat_least = 0.5\nover_best = true";
        assert_eq!(
            told(strict)[0].1,
            TargetVerdict::Short,
            "a failed flight is not twice as bad as the best: it is no figure"
        );
        let ratio = verdicts(&format!("{lax}at_most = 1.0\nover_best = true"), 0);
        assert_eq!(
            (ratio[0].measured, ratio[0].verdict),
            (Some(1.0), TargetVerdict::Ok),
            "lax is the best that passed"
        );
    }

    #[test]
    fn a_promise_is_about_the_flights_that_have_its_values() {
        let at = |mass: &str| {
            told(&format!("at = {{ \"plant.airframe.mass_kg\" = {mass} }}\ncontrollers = [\"lax\"]\npassed = \"all\""))
        };
        assert_eq!(at("1.15")[0].1, TargetVerdict::Ok);
        assert_eq!(at("1.3")[0].1, TargetVerdict::Inconclusive, "no such flight");
        let missing = verdicts("controllers = [\"lax\"]\npassed = \"all\"", 2);
        assert_eq!(
            (missing[0].verdict, missing[0].note.as_str()),
            (TargetVerdict::Inconclusive, "not all of its flights are there")
        );
    }

    #[test]
    fn a_promise_that_cannot_be_judged_is_refused() {
        let said = |promise: &str| {
            let text = format!("{CAMPAIGN}[[promise]]\nfigure = \"x\"\n{promise}");
            format!("{:#}", Campaign::read(&text, "x.toml", "x", Path::new("")).unwrap_err())
        };
        for (promise, part) in [
            ("passed = \"all\"\ncontrollers = [\"laxer\"]", "no controller \"laxer\"; there are lax, strict"),
            ("passed = \"all\"\ncases = [\"storm\"]", "no case \"storm\""),
            ("passed = \"all\"\nat = { \"attitude.law\" = 3 }", "no list of values of \"attitude.law\""),
            ("metric = \"error\"\nat_most = 1.0", "no metric \"error\""),
            ("metric = \"flown_s\"", "give `at_most` or `at_least`"),
            ("passed = \"share\"", "give the share"),
            ("passed = \"share\"\nat_least = 1.5\ncontrollers = [\"lax\"]", "from 0 to 1"),
            ("passed = \"share\"\nat_least = 0.5", "name the `controllers`"),
            ("passed = \"all\"\nof = \"max\"", "`of` applies only to a `metric`"),
            ("metric = \"flown_s\"\nat_most = inf", "give a finite limit"),
            ("passed = \"all\"\nat_most = 1.0", "`passed` needs no limit"),
            ("", "give either `metric` or `passed`"),
        ] {
            assert!(said(promise).contains(part), "{promise}: {}", said(promise));
        }
    }
}
