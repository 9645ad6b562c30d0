//! A campaign: its file, read and checked, with the settings of each controller and case.

use std::path::Path;

use anyhow::{Context, bail, ensure};
use flight::programs;
use flight::programs::hex;
use folder::shipped;
use settings::{Given, find_programs};
use sha2::{Digest, Sha256};
use toml::{Table, Value};

use crate::compare::Compare;
use crate::form::{File, MAX_SAMPLES, ONLY, Seeds, not_a_campaign, text_of};
use crate::limit::Limit;
use crate::own_controller::OwnController;
use crate::promise::Promise;
use crate::random_faults::RandomFaults;
use crate::sampling::{MAX_SOBOL, Sampling};
use crate::tune::Tune;
use crate::variation::{Factor, RequestedValues, Values};

/// Largest number of flights of a campaign.
const MAX_FLIGHTS: u64 = 10_000_000;
/// Key of the seed; every flight has a value of it.
pub const SEED: &str = "run.seed";
/// Key of the case; a flight has a value of it if the file has cases.
pub const CASE: &str = "case";

/// Campaign as read from its file.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// Contents of the file, with the scenario merged into `settings`.
    file: File,
    /// Names of the controllers, each with the settings of its flights outside of a case.
    pub controllers: Vec<(String, Given)>,
    /// Names of the cases, each with the settings of its flights by controller.
    cases: Vec<(String, Vec<Given>)>,
    /// Factors, sorted by key; for Sobol points in the order of the file, which is the order of the dimensions.
    pub factors: Vec<Factor>,
}

impl Campaign {
    /// Reads the campaign of a file.
    ///
    /// # Errors
    /// Anything that makes the campaign impossible to fly, with the place and what to do.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        Self::load_with(path, &[])
    }

    /// Reads the campaign of a file, or the shipped one of that name, with controllers of the command line beside its
    /// own.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn load_with(path: &Path, own: &[OwnController]) -> anyhow::Result<Self> {
        let (path, text) = text_of(path)?;
        let stem = path.file_stem().map_or("campaign".into(), |stem| stem.to_string_lossy().into_owned());
        let origin = path.display().to_string();
        Self::read_with(&text, &origin, &stem, path.parent().unwrap_or(Path::new("")), own)
    }

    /// Reads the campaign of a text; the path of its scenario is relative to `folder`.
    pub fn read(text: &str, origin: &str, name: &str, folder: &Path) -> anyhow::Result<Self> {
        Self::read_with(text, origin, name, folder, &[])
    }

    /// Reads the campaign of a text, with controllers of the command line beside its own.
    pub fn read_with(
        text: &str,
        origin: &str,
        name: &str,
        folder: &Path,
        own: &[OwnController],
    ) -> anyhow::Result<Self> {
        let mut file: File = toml::from_str(text).map_err(|error| not_a_campaign(origin, text, &error))?;
        file.controller.put_in_order(text, "controller");
        file.case.put_in_order(text, CASE);
        if let Some(path) = file.controllers.take() {
            file.add_controllers_of(&folder.join(path)).with_context(|| format!("`controllers` of {origin}"))?;
        }
        file.add_own(own).with_context(|| origin.to_owned())?;
        let name = file.name.get_or_insert_with(|| name.to_owned());
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        ensure!(
            !name.is_empty() && name.chars().all(is_plain) && !name.starts_with('.'),
            "{origin}: `name` = {name:?}: give letters, digits, - and _: the folder of the results has this name"
        );
        let scenario = file.scenario.take().map(|scenario| folder.join(scenario));
        let scenario = scenario.as_deref().map(shipped::scenario).transpose()?;
        let scenario = Given::load_from(scenario, &[])?;
        let tables = file.controller.0.iter_mut().chain(&mut file.case.0).map(|(_, own)| own);
        tables.chain([&mut file.settings]).for_each(|own| find_programs(own, folder));
        let with_settings = |scenario: &Given, settings: &Table| {
            let given = scenario.with(settings, &format!("[settings] of {origin}"))?.with(&in_process(), "")?;
            given.with_programs(programs::pin)
        };
        for (name, own) in &mut file.controller.0 {
            let given = Given::default().with(own, &format!("[controller.{name}] of {origin}"))?;
            own.clone_from(given.with_programs(programs::pin)?.table());
        }
        let base = with_settings(&scenario, &file.settings)?;
        let under_each_controller = |base: &Given| -> anyhow::Result<Vec<(String, Given)>> {
            let under = |(name, own): &(String, Table)| {
                Ok((name.clone(), base.with(own, &format!("[controller.{name}] of {origin}"))?))
            };
            let all: Vec<_> = file.controller.0.iter().map(under).collect::<anyhow::Result<_>>()?;
            Ok(if all.is_empty() { vec![(ONLY.into(), base.clone())] } else { all })
        };
        let controllers = under_each_controller(&base)?;
        let mut cases = vec![];
        for (name, own) in &mut file.case.0 {
            let above = match own.remove("scenario") {
                None => scenario.clone(),
                Some(Value::String(path)) => {
                    let own = Given::load_from(Some(shipped::scenario(&folder.join(path))?), &[])?;
                    scenario.with(own.table(), "")?
                }
                Some(other) => bail!("{origin}: `scenario` = {other} in [case.{name}]: give the path of a scenario"),
            };
            let case = with_settings(&above, &file.settings)?.with(own, &format!("[case.{name}] of {origin}"))?;
            let case = case.with_programs(programs::pin)?;
            let by_controller = under_each_controller(&case)?.into_iter().map(|(_, given)| given).collect();
            *own = case.table().clone();
            cases.push((name.clone(), by_controller));
        }
        file.settings = base.table().clone();
        let is_in_order = file.sampling == Some(Sampling::Sobol);
        if is_in_order {
            file.vary.put_in_order(text).with_context(|| origin.to_owned())?;
        }
        let mut wanted = RequestedValues::all(&file.vary).with_context(|| origin.to_owned())?;
        wanted.extend(file.seeds.as_ref().map(seeds).transpose().with_context(|| origin.to_owned())?);
        let names: Vec<Value> = cases.iter().map(|(name, _)| Value::String(name.clone())).collect();
        wanted.extend((!names.is_empty()).then(|| RequestedValues::listed(CASE, names)));
        check_flights(&wanted, file.samples.unwrap_or(1), controllers.len()).with_context(|| origin.to_owned())?;
        let factors = wanted.into_iter().map(RequestedValues::factor).collect::<anyhow::Result<_>>();
        let mut factors: Vec<Factor> = factors.with_context(|| origin.to_owned())?;
        if !is_in_order {
            factors.sort_by(|a, b| a.key.cmp(&b.key));
        }
        let campaign = Self { file, controllers, cases, factors };
        campaign.check().with_context(|| origin.to_owned())?;
        Ok(campaign)
    }

    pub fn name(&self) -> &str {
        self.file.name.as_deref().unwrap_or_default()
    }

    pub fn seed(&self) -> u64 {
        u64::from(self.file.seed)
    }

    /// Number of samples to draw; `None` if the file does not give it.
    pub fn samples(&self) -> Option<u64> {
        self.file.samples
    }

    pub fn sampling(&self) -> Sampling {
        self.file.sampling.unwrap_or_default()
    }

    pub fn random_faults(&self) -> Option<&RandomFaults> {
        self.file.random_faults.as_ref()
    }

    /// Returns `[limit]`, if the file has it: each number of the plan is then a search of several flights.
    pub fn limit(&self) -> Option<&Limit> {
        self.file.limit.as_ref()
    }

    /// Word for the entries of the plan, in the plural: flights or searches.
    pub fn units(&self) -> &'static str {
        if self.file.limit.is_some() { "searches" } else { "flights" }
    }

    /// Returns `[tune]`, if the file has it.
    pub fn tune(&self) -> Option<&Tune> {
        self.file.tune.as_ref()
    }

    /// Returns `[compare]`, if the file has it.
    pub fn compare(&self) -> Option<&Compare> {
        self.file.compare.as_ref()
    }

    pub fn promises(&self) -> &[Promise] {
        &self.file.promise
    }

    /// Returns the names of the cases; none if the file has no cases.
    pub fn cases(&self) -> impl Iterator<Item = &str> {
        self.cases.iter().map(|(name, _)| name.as_str())
    }

    /// Returns the settings under controller number `controller`, in the case named `case`; `None` for a file without
    /// cases.
    pub fn given(&self, controller: usize, case: Option<&str>) -> &Given {
        let case = self.cases.iter().find(|(name, _)| Some(name.as_str()) == case);
        case.map_or(&self.controllers[controller].1, |(_, by_controller)| &by_controller[controller])
    }

    /// Returns the settings under every controller, in the case named `case`; in every case if `case` is `None`.
    pub fn givens(&self, case: Option<&str>) -> Vec<&Given> {
        let outside = self.controllers.iter().filter(|_| self.cases.is_empty()).map(|(_, given)| given);
        let cases = self.cases.iter().filter(|(name, _)| case.is_none_or(|case| name == case));
        outside.chain(cases.flat_map(|(_, by_controller)| by_controller)).collect()
    }

    /// Replaces the number of samples and the seed of the draws.
    #[must_use]
    pub fn drawn_anew(mut self, seed: u32, samples: u64) -> Self {
        (self.file.seed, self.file.samples) = (seed, Some(samples));
        self
    }

    /// Returns the campaign as TOML that needs no scenario file.
    pub fn merged(&self) -> String {
        toml::to_string(&self.file).expect("it was read from TOML")
    }

    /// SHA-256 of [`merged`](Self::merged), which identifies the campaign.
    pub fn hash(&self) -> String {
        hex(&Sha256::digest(self.merged()))
    }

    /// Number of flights: samples times listed values times controllers.
    pub fn flights(&self) -> u64 {
        let listed = self.factors.iter().map(|factor| match &factor.values {
            Values::Listed(list) => list.len() as u64,
            Values::Drawn(_) => 1,
        });
        let others = [self.samples().unwrap_or(1), self.controllers.len() as u64];
        listed.chain(others).fold(1, u64::saturating_mul)
    }

    /// Checks the parts of the file against each other.
    fn check(&self) -> anyhow::Result<()> {
        let drawn = self.factors.iter().filter(|factor| matches!(factor.values, Values::Drawn(_))).count();
        if let Some(faults) = &self.file.random_faults {
            faults.check().context("[random_faults]")?;
        }
        if let Some(tune) = &self.file.tune {
            ensure!(drawn > 0 || self.file.random_faults.is_some(), "[tune] has no draws to train on");
            tune.check(&self.controllers).context("[tune]")?;
        }
        self.check_limit()?;
        match (self.file.samples, drawn > 0 || self.file.random_faults.is_some()) {
            (Some(0), _) => bail!("`samples` = 0: give how often to draw, 1 or more"),
            (Some(samples), _) if samples > MAX_SAMPLES => {
                bail!("`samples` = {samples} is too many: at most {MAX_SAMPLES}")
            }
            (None, true) => {
                bail!("something is drawn, but not how often: give `samples`, for instance `samples = 100`")
            }
            (Some(_), false) => {
                bail!(
                    "`samples` without anything that is drawn: remove it, or say `seeds` for flights with other noise"
                )
            }
            _ => {}
        }
        ensure!(self.file.sampling.is_none() || drawn > 0, "`sampling` without a distribution in [vary]: remove it");
        let (dimensions, samples) = MAX_SOBOL;
        ensure!(
            self.sampling() != Sampling::Sobol || drawn <= dimensions && self.samples().unwrap_or(0) <= samples,
            "`sampling` = \"sobol\" has {samples} samples of {dimensions} settings at most; say \"latin-hypercube\" for more"
        );
        for (i, Factor { key: whole, .. }) in self.factors.iter().enumerate() {
            let others = self.factors.iter().enumerate().filter(|(other, _)| *other != i);
            for (_, Factor { key, .. }) in others {
                ensure!(key != whole, "`{key}` varies twice, by `seeds` and in [vary]: remove one of them");
                ensure!(
                    !is_part(whole, key),
                    "`{key}` in [vary] is a part of `{whole}`, which varies too: remove one of them"
                );
            }
        }
        for Factor { key, .. } in &self.factors {
            ensure!(
                key != "run.mode" && key != "name",
                "`{key}` in [vary]: every flight of a campaign flies in process under the name of its number"
            );
            ensure!(
                !(key.starts_with("node.") && key.split('.').nth(2) == Some("exec")),
                "`{key}` in [vary]: give each library a [controller.NAME] of its own, so that its hash is kept"
            );
            for (name, own) in &self.file.controller.0 {
                ensure!(find(own, key).is_none(), "`{key}` of [controller.{name}] varies too: remove one of them");
            }
        }
        let controllers: Vec<&str> = self.controllers.iter().map(|(name, _)| name.as_str()).collect();
        let cases: Vec<&str> = self.cases().collect();
        let listed = self.factors.iter().filter(|factor| matches!(factor.values, Values::Listed(_)));
        let listed: Vec<&str> = listed.map(|factor| factor.key.as_str()).collect();
        self.compare().map_or(Ok(()), |compare| compare.check(&controllers))?;
        self.promises().iter().try_for_each(|promise| promise.check(&controllers, &cases, &listed, self.limit()))
    }

    /// Checks `[limit]` against the other tables.
    fn check_limit(&self) -> anyhow::Result<()> {
        let Some(limit) = self.limit() else { return Ok(()) };
        limit.check().context("[limit]")?;
        let key = &limit.key;
        ensure!(key != SEED, "`{key}` has no safe end: search another setting");
        for Factor { key: varied, .. } in &self.factors {
            ensure!(
                varied != key && !is_part(varied, key) && !is_part(key, varied),
                "`{key}` of [limit] and `{varied}` vary the same setting: remove one of them"
            );
        }
        for (name, own) in &self.file.controller.0 {
            ensure!(find(own, key).is_none(), "`{key}` of [limit] stands in [controller.{name}] too: remove it there");
        }
        ensure!(
            self.file.tune.is_none(),
            "[limit] and [tune] do not go together: a limit is searched with gains that are known; give [tune] a file of its own"
        );
        ensure!(
            self.file.compare.is_none(),
            "[limit] and [compare] do not go together: the flights of two limits have different settings; remove [compare]"
        );
        Ok(())
    }
}

/// Returns `seeds` as a list of values of [`SEED`].
fn seeds(seeds: &Seeds) -> anyhow::Result<RequestedValues> {
    let wanted = match seeds {
        Seeds::Count(count) => RequestedValues::up_to(SEED, *count),
        Seeds::List(list) => {
            RequestedValues::listed(SEED, list.iter().map(|seed| Value::Integer((*seed).into())).collect())
        }
    };
    ensure!(wanted.count() > 0, "`seeds` is empty: give how many seeds, 1 or more, or a list of them");
    Ok(wanted)
}

/// Refuses too many flights before any value is made, because billions of values would fill the memory.
fn check_flights(wanted: &[RequestedValues], samples: u64, controllers: usize) -> anyhow::Result<()> {
    let counts = wanted.iter().map(RequestedValues::count).chain([samples, controllers as u64]);
    let flights = counts.fold(1, u64::saturating_mul);
    let most = wanted.iter().max_by_key(|wanted| wanted.count());
    let most = most.map_or(String::new(), |most| format!("; `{}` alone has {} values", most.key, most.count()));
    ensure!(flights <= MAX_FLIGHTS, "{flights} flights are too many: at most {MAX_FLIGHTS}{most}");
    Ok(())
}

/// Settings of every flight: `run.mode = "inprocess"`.
fn in_process() -> Table {
    let run = Table::from_iter([("mode".to_owned(), Value::from("inprocess"))]);
    Table::from_iter([("run".to_owned(), Value::Table(run))])
}

/// Returns whether the dotted key `part` stands below `whole`.
fn is_part(whole: &str, part: &str) -> bool {
    part.strip_prefix(whole).is_some_and(|rest| rest.starts_with('.'))
}

/// Returns the value of a dotted key.
fn find<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    match key.split_once('.') {
        None => table.get(key),
        Some((first, rest)) => table.get(first)?.as_table().and_then(|inner| find(inner, rest)),
    }
}

#[cfg(test)]
mod tests;
