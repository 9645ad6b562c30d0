//! Tables as aligned text and as HTML.

use crate::draw;

/// A title, a heading for each column, and rows of as many cells. The first column names the row.
pub struct Table {
    pub title: String,
    pub headings: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(title: &str, headings: &[&str], rows: Vec<Vec<String>>) -> Self {
        Self { title: title.to_owned(), headings: headings.iter().map(|&heading| heading.to_owned()).collect(), rows }
    }

    /// Formats the table as text. The first column and columns with words are aligned left, columns of numbers right.
    pub fn text(&self) -> String {
        let lines = || std::iter::once(&self.headings).chain(&self.rows);
        let is_number = |cell: &String| cell.starts_with(|first: char| first.is_ascii_digit() || "->".contains(first));
        let columns: Vec<(usize, bool)> = (0..self.headings.len())
            .map(|i| {
                let width = lines().map(|line| line[i].chars().count()).max().unwrap_or(0);
                (width, i > 0 && self.rows.iter().all(|row| is_number(&row[i])))
            })
            .collect();
        let mut text = format!("{}\n", self.title);
        for line in lines() {
            let cells = line.iter().zip(&columns).map(|(cell, &(width, is_right))| {
                if is_right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
            });
            text += cells.collect::<Vec<_>>().join("  ").trim_end();
            text.push('\n');
        }
        text
    }

    /// Formats the table for a page, without the title.
    pub fn html(&self) -> String {
        let headings: Vec<&str> = self.headings.iter().map(String::as_str).collect();
        draw::table(&headings, self.rows.iter().map(|row| row.iter().map(|cell| draw::breakable(cell)).collect()))
    }
}

/// Formats a value with `places` decimals; `-` for `None`.
pub fn cell(value: Option<f64>, places: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.places$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_right_and_words_left() {
        let row = |cells: [&str; 3]| cells.map(str::to_owned).to_vec();
        let table = Table::new("T", &["", "how", "n"], vec![row(["mixer", "idle", "7"]), row(["b", "loaded", "-"])]);
        assert_eq!(table.text(), "T\n       how     n\nmixer  idle    7\nb      loaded  -\n");
    }
}
