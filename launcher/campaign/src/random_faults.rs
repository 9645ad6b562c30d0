//! `[random_faults]`: faults drawn from the catalogue for each sample, at random times.
//!
//! The faults of a sample depend neither on the controller nor on the listed values, so that these are compared under
//! equal faults. Sizes are the defaults of the kinds.

use anyhow::{bail, ensure};
use flight::event::name;
use rand::RngExt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Fault, FaultKind, FaultTarget, MAX_FAULT_S, Scenario, check_fault};

use crate::sampling::{Purpose, stream};
use crate::table::{Cell, ColumnType};

/// Largest number of faults that a flight may draw.
const MAX_COUNT: u32 = 20;

/// Settings of `[random_faults]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RandomFaults {
    /// Least and largest number of faults of a flight; each number between has the same chance.
    pub count: [u32; 2],
    /// Earliest and latest begin of a fault \[s\]; uniform between.
    pub at_s: [f64; 2],
    /// Shortest and longest duration of a fault \[s\]; uniform between.
    pub for_s: [f64; 2],
    /// Targets that may be drawn; `None` = all with faults in process except the plant, which every flight needs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub targets: Option<Vec<FaultTarget>>,
    /// Kinds that may be drawn; `None` = all that the target can have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kinds: Option<Vec<FaultKind>>,
}

impl RandomFaults {
    /// Checks counts and times.
    pub fn check(&self) -> anyhow::Result<()> {
        let [least, most] = self.count;
        ensure!(
            least <= most && (1..=MAX_COUNT).contains(&most),
            "`count` = [{least}, {most}]: give two numbers up to {MAX_COUNT}, the smaller one first"
        );
        for (key, [from, to]) in [("at_s", self.at_s), ("for_s", self.for_s)] {
            ensure!(
                (0.0..=to).contains(&from) && to <= MAX_FAULT_S,
                "`{key}` = [{from}, {to}]: give two times of 0 to {MAX_FAULT_S} s, the earlier one first"
            );
        }
        Ok(())
    }

    /// Checks that every fault begins before the end of the flight.
    pub fn check_end(&self, duration_s: f64) -> anyhow::Result<()> {
        let at_s = self.at_s;
        ensure!(
            at_s[1] < duration_s,
            "`at_s` = {at_s:?}: a flight ends after {duration_s} s, and a later fault would do nothing; let the last begin before"
        );
        Ok(())
    }

    /// Returns the pairs of target and kind that all `scenarios` allow.
    ///
    /// # Errors
    /// A target or kind adds no pair, or there is no pair at all.
    pub fn pairs(&self, scenarios: &[Scenario]) -> anyhow::Result<Vec<(FaultTarget, FaultKind)>> {
        let is_target =
            |target| self.targets.as_ref().map_or(target != FaultTarget::Plant, |all| all.contains(&target));
        let is_kind = |kind| self.kinds.as_ref().is_none_or(|all| all.contains(&kind));
        let refused = |target, kind| {
            let fault = Fault::new(target, kind, self.at_s[0], Some(self.for_s[1]));
            scenarios.iter().find_map(|scenario| check_fault(scenario, &fault).err())
        };
        let mut pairs = vec![];
        for (target, _) in FaultTarget::ALL.iter().filter(|(target, _)| is_target(*target)) {
            // A fault of the log changes no flight.
            let meant = || target.kinds().iter().filter(|kind| is_kind(**kind) && **kind != FaultKind::DiskFull);
            pairs.extend(meant().filter(|kind| refused(*target, **kind).is_none()).map(|kind| (*target, *kind)));
            if self.targets.is_none() || pairs.last().is_some_and(|(of, _)| of == target) {
                continue;
            }
            match meant().find_map(|kind| refused(*target, *kind)) {
                Some(why) => bail!("`targets`: `{}`: {}", target.name(), why.in_one_line()),
                None => {
                    bail!("`targets`: `{}` has none of these `kinds`; it has {}", target.name(), names(target.kinds()))
                }
            }
        }
        for kind in self.kinds.iter().flatten() {
            ensure!(
                pairs.iter().any(|(_, of)| of == kind),
                "`kinds`: none of the targets can have the fault {} in an in-process flight",
                name(kind)
            );
        }
        ensure!(!pairs.is_empty(), "no fault can be drawn");
        Ok(pairs)
    }

    /// Columns for the largest number of faults of a flight.
    pub fn columns(&self) -> Vec<(String, ColumnType)> {
        let fields = [
            ("target", ColumnType::Text),
            ("kind", ColumnType::Text),
            ("at_s", ColumnType::Real),
            ("for_s", ColumnType::Real),
        ];
        (0..self.count[1])
            .flat_map(|i| fields.map(|(field, kind)| (format!("random_fault.{i}.{field}"), kind)))
            .collect()
    }

    /// Cells of [`columns`](Self::columns).
    pub fn cells(&self, faults: &[Fault]) -> Vec<Cell> {
        let of_fault = |i: u32| match faults.get(i as usize) {
            Some(fault) => [
                Cell::Text(fault.target.name().into()),
                Cell::Text(name(fault.kind)),
                Cell::Real(fault.at_s),
                fault.for_s.map_or(Cell::None, Cell::Real),
            ],
            None => [Cell::None, Cell::None, Cell::None, Cell::None],
        };
        (0..self.count[1]).flat_map(of_fault).collect()
    }

    /// Draws the faults of a sample from `pairs`, sorted by the time they begin.
    pub fn draw(&self, pairs: &[(FaultTarget, FaultKind)], seed: u64, sample: u64) -> Vec<Fault> {
        let mut rng = stream(seed, Purpose::Faults, sample);
        let count = rng.random_range(self.count[0]..=self.count[1]);
        // Each pair of the catalogue gets a random number, and the possible pair with the smallest is drawn. So a pair
        // that becomes impossible with one more controller changes only the faults that had it.
        let catalogue =
            || FaultTarget::ALL.iter().flat_map(|(target, _)| target.kinds().iter().map(|kind| (*target, *kind)));
        let mut faults: Vec<Fault> = (0..count)
            .filter_map(|_| {
                let numbered: Vec<(u64, _)> = catalogue().map(|pair| (rng.random(), pair)).collect();
                let possible = numbered.into_iter().filter(|(_, pair)| pairs.contains(pair));
                let (_, (target, kind)) = possible.min_by_key(|(number, _)| *number)?;
                let [at_s, for_s] = [self.at_s, self.for_s].map(|[from, to]| rng.random_range(from..=to));
                let fault = Fault::new(target, kind, at_s, Some(for_s));
                Some(if fault.is_momentary() { Fault { for_s: None, ..fault } } else { fault })
            })
            .collect();
        faults.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        faults
    }
}

/// Names of kinds, as in a scenario.
fn names(kinds: &[FaultKind]) -> String {
    kinds.iter().map(name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use settings::load;

    use super::*;

    fn all() -> RandomFaults {
        RandomFaults { count: [0, 3], at_s: [2.0, 15.0], for_s: [0.1, 2.0], targets: None, kinds: None }
    }

    fn in_process(set: &str) -> Scenario {
        load(None, &["run.mode=inprocess".into(), set.into()]).unwrap()
    }

    #[test]
    fn drawn_faults_repeat_and_are_valid_for_every_controller() {
        let scenarios = [in_process("attitude.law=lqr"), in_process("attitude.law=mpc")];
        let faults = all();
        let pairs = faults.pairs(&scenarios).unwrap();
        assert!(
            pairs.len() > 50 && !pairs.iter().any(|(target, _)| *target == FaultTarget::Mpc),
            "an LQR has no solver"
        );
        let mut counts = [0; 4];
        for sample in 0..200 {
            let drawn = faults.draw(&pairs, 1, sample);
            assert_eq!(drawn, faults.draw(&pairs, 1, sample));
            counts[drawn.len()] += 1;
            for (fault, scenario) in drawn.iter().flat_map(|fault| scenarios.iter().map(move |s| (fault, s))) {
                check_fault(scenario, fault).unwrap();
                assert!((2.0..=15.0).contains(&fault.at_s));
            }
        }
        assert!(counts.iter().all(|count| (20..90).contains(count)), "{counts:?}");
    }

    #[test]
    fn a_pair_that_falls_away_changes_only_the_faults_that_had_it() {
        let faults = all();
        let [fewer, more] =
            [["attitude.law=lqr", "attitude.mpc.constraints=cone"].as_slice(), &["attitude.mpc.constraints=cone"]]
                .map(|laws| faults.pairs(&laws.iter().map(|law| in_process(law)).collect::<Vec<_>>()).unwrap());
        assert!(fewer.len() < more.len());
        let mut changed = 0;
        for sample in 0..200 {
            let [before, after] = [&more, &fewer].map(|pairs| faults.draw(pairs, 1, sample));
            assert_eq!(before.len(), after.len());
            for (before, after) in before.iter().zip(&after) {
                let falls_away = !fewer.contains(&(before.target, before.kind));
                assert!(falls_away || before == after, "{before:?} {after:?}");
                assert_eq!(before.at_s, after.at_s);
                changed += u32::from(falls_away);
            }
        }
        assert!(changed > 0);
    }

    #[test]
    fn a_target_or_kind_without_effect_is_refused() {
        let scenarios = [in_process("attitude.law=lqr")];
        let refused = |faults: RandomFaults| faults.pairs(&scenarios).unwrap_err().to_string();
        assert!(refused(RandomFaults { targets: Some(vec![FaultTarget::Mpc]), ..all() }).contains("`mpc`"));
        let on_topics =
            RandomFaults { targets: Some(vec![FaultTarget::State]), kinds: Some(vec![FaultKind::Kill]), ..all() };
        assert!(refused(on_topics).starts_with("`targets`: `state` has none of these `kinds`; it has "));
        assert!(all().check_end(20.0).is_ok() && all().check_end(15.0).is_err());
        assert!(RandomFaults { count: [2, 1], ..all() }.check().is_err());
        assert!(RandomFaults { at_s: [2.0, 1.0], ..all() }.check().is_err());
    }
}
