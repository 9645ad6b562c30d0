//! Head of the page, share of each controller, causes of failures, and reasons why flights could not be flown.

use std::collections::BTreeMap;

use view::draw::{self, escape, list};

use super::bounds;
use super::data::CampaignPage;
use super::limits;
use crate::rate::Rate;

/// Largest number of reasons that are shown.
const REASONS: usize = 12;

impl CampaignPage<'_> {
    pub fn head(&self) -> String {
        let (there, planned) = (self.rows() as u64, self.plan.flights());
        let partial = if there < planned {
            format!(
                "<p class=\"warn\">{there} of {planned} {} are there: the same command flies the others.</p>",
                self.plan.campaign.units()
            )
        } else {
            String::new()
        };
        let grounds: Vec<String> = self.grounds().iter().map(|words| format!("<p>{}</p>", escape(words))).collect();
        [
            self.title(),
            partial,
            self.tiles(),
            format!("<p>{}</p>", escape(&bounds::passed(&self.bounds))),
            grounds.concat(),
        ]
        .concat()
    }

    /// Returns sentences on the basis of the figures, and on copies.
    pub fn grounds(&self) -> Vec<String> {
        let basis = match self.plan.campaign.limit() {
            Some(limit) => limits::sentences(self, limit),
            None => self.evidence.sentences(self.each()),
        };
        [vec![basis], self.evidence.copies(&self.names)].concat()
    }

    /// Renders name and origin.
    pub fn title(&self) -> String {
        format!(
            "<p class=\"kind\">Campaign</p><h1>{}</h1><p class=\"facts\"><span><b>{}</b> {}</span>\
             <span>seed <b>{}</b></span><span>campaign <b>{}</b></span></p>",
            escape(self.plan.campaign.name()),
            self.rows(),
            self.plan.campaign.units(),
            self.plan.campaign.seed(),
            &self.plan.campaign.hash()[..12],
        )
    }

    /// Renders the numbers of all flights that are there.
    pub fn tiles(&self) -> String {
        let planned = self.plan.flights();
        let all = self.rate(|_| true);
        let invalid = self.rows() - all.flights;
        let mut tiles = vec![];
        if let Some(limit) = self.plan.campaign.limit() {
            tiles.extend(limits::tiles(self, limit));
            tiles.push(("draws".to_owned(), self.evidence.all_draws().to_string()));
            tiles.push(("invalid: could not be flown".to_owned(), invalid.to_string()));
            return format!("<div class=\"tiles\">{}</div>", list(tiles));
        }
        // A rate pooled over several controllers is the rate of none of them.
        if self.names.len() == 1 {
            let share = if all.flights == 0 { draw::DASH.to_owned() } else { percent(&all, " <small>%</small>") };
            tiles.push(("passed".to_owned(), share));
            tiles.push(("95 % interval".to_owned(), all.interval()));
        } else {
            tiles.push(("controllers".to_owned(), self.names.len().to_string()));
            tiles.push(("flights of each of them".to_owned(), (planned / self.names.len() as u64).to_string()));
        }
        tiles.push(("draws".to_owned(), self.evidence.all_draws().to_string()));
        tiles.push(("different flights".to_owned(), format!("{} of {}", self.evidence.distinct, self.evidence.flown)));
        tiles.push(("failed".to_owned(), (all.flights - all.survived).to_string()));
        tiles.push(("invalid: could not be flown, neither passed nor failed".to_owned(), invalid.to_string()));
        format!("<div class=\"tiles\">{}</div>", list(tiles))
    }

    /// Renders how many flights of each controller are there, and how they ended.
    pub fn counts(&self) -> String {
        let row = |(i, name): (usize, &&str)| {
            let of = |passed: Option<bool>| {
                let is = |row: &usize| self.controllers[*row] == i && self.passed[*row] == passed;
                (0..self.rows()).filter(is).count().to_string()
            };
            let there = self.controllers.iter().filter(|controller| **controller == i).count().to_string();
            vec![escape(name), there, of(Some(true)), of(Some(false)), of(None)]
        };
        let headings = ["controller", "there", "passed", "failed", "could not be flown"];
        let table = draw::table(&headings, self.names.iter().enumerate().map(row));
        format!("<section id=\"counts\"><h2>Flights so far</h2>{table}</section>")
    }

    pub fn controllers_section(&self) -> String {
        if self.names.len() == 1 {
            return String::new();
        }
        let row = |(name, rate): (&str, Rate)| {
            let (share, picture) = match rate.flights {
                0 => (draw::DASH.to_owned(), String::new()),
                _ => (percent(&rate, " %"), draw::interval(&rate.picture())),
            };
            vec![escape(name), rate.survived.to_string(), rate.flights.to_string(), share, rate.interval(), picture]
        };
        let headings = ["controller", "passed", "of", "share", "95 % interval", "0 to 100 %"];
        let table = draw::table(&headings, self.rates().into_iter().map(row));
        format!(
            "<section id=\"controllers\"><h2>Controllers</h2><p>The share of flights passed. Intervals that overlap do not say \
             that the controllers are alike: the next table compares them draw by draw.</p>{table}</section>"
        )
    }

    /// Renders the causes of failures, by controller.
    pub fn causes(&self) -> String {
        let Some(causes) = self.flights.column("cause") else { return String::new() };
        let mut counts: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for row in (0..self.rows()).filter(|row| self.passed[*row] == Some(false)) {
            counts.entry(causes.text(row)).or_insert_with(|| vec![0; self.names.len()])[self.controllers[row]] += 1;
        }
        if counts.is_empty() {
            return String::new();
        }
        let mut counts: Vec<(&str, Vec<usize>)> = counts.into_iter().collect();
        counts.sort_by_key(|(_, counts)| std::cmp::Reverse(counts.iter().sum::<usize>()));
        let headings: Vec<&str> = std::iter::once("controller").chain(counts.iter().map(|(cause, _)| *cause)).collect();
        let row = |(i, name): (usize, &&str)| {
            std::iter::once(escape(name)).chain(counts.iter().map(|(_, counts)| counts[i].to_string())).collect()
        };
        let table = draw::table(&headings, self.names.iter().enumerate().map(row));
        format!(
            "<section id=\"causes\"><h2>Why flights failed</h2><p>Failed flights by their cause.</p>{table}</section>"
        )
    }

    /// Renders the reasons why flights could not be flown.
    pub fn invalid(&self) -> String {
        let Some(outcomes) = self.flights.column("outcome") else { return String::new() };
        let mut reasons: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
        for row in (0..self.rows()).filter(|row| self.passed[*row].is_none()) {
            reasons.entry(outcomes.text(row)).or_default().push(self.numbers[row]);
        }
        if reasons.is_empty() {
            return String::new();
        }
        let mut reasons: Vec<(&str, Vec<u64>)> = reasons.into_iter().collect();
        reasons.sort_by_key(|(_, numbers)| std::cmp::Reverse(numbers.len()));
        let others = match reasons.len() {
            0..=REASONS => String::new(),
            all => format!("<p>{} more reasons are in the column <code>outcome</code>.</p>", all - REASONS),
        };
        let row = |(reason, numbers): &(&str, Vec<u64>)| {
            vec![escape(reason), numbers.len().to_string(), numbers[0].to_string()]
        };
        let table = draw::table(&["reason", "flights", "the first"], reasons.iter().take(REASONS).map(row));
        format!(
            "<section id=\"invalid\"><h2>Flights that could not be flown</h2><p>They count as neither passed nor \
             failed.</p>{table}{others}</section>"
        )
    }
}

/// Formats the share of a rate in percent.
fn percent(rate: &Rate, sign: &str) -> String {
    format!("{:.1}{sign}", 100.0 * rate.share)
}
