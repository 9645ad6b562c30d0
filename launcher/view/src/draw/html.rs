//! Small pieces of HTML: escaped text, numbers with a dash for a missing value, tables.

use serde_json::Value;

use super::time_plots::{SCRIPTS, UPLOT_STYLE};

pub const DASH: &str = "–";

/// Escapes text for element content and quoted attributes.
pub fn escape(text: &str) -> String {
    let names = [('&', "&amp;"), ('<', "&lt;"), ('>', "&gt;"), ('"', "&quot;"), ('\'', "&#39;")]; // & first
    names.iter().fold(text.to_owned(), |text, (c, name)| text.replace(*c, name))
}

/// Escapes text. Long words may be broken after a slash or an underscore; ranges of numbers may not be broken.
pub fn breakable(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let is_digit = |i: usize| chars.get(i).is_some_and(char::is_ascii_digit);
    let mut kept = String::with_capacity(text.len());
    for (i, c) in chars.iter().enumerate() {
        kept.push(*c);
        if *c == '-' && i > 0 && is_digit(i - 1) && is_digit(i + 1) {
            kept.push('\u{2060}'); // word joiner
        }
    }
    escape(&kept).replace('/', "/<wbr>").replace('_', "_<wbr>")
}

/// Formats a number with `decimals` decimals, from 1e7 on with an exponent; the dash for `None` and NaN.
pub fn number(value: impl Into<Option<f64>>, decimals: usize) -> String {
    match value.into().filter(|x| !x.is_nan()) {
        Some(x) if x.abs() >= 1e7 => format!("{x:.2e}"),
        Some(x) => format!("{x:.decimals$}"),
        None => DASH.into(),
    }
}

/// Formats any value for people, escaped: strings as they are, lists of strings as words, objects as names and values,
/// null as the dash.
pub fn any(value: &Value) -> String {
    match value {
        Value::Null => DASH.into(),
        Value::String(text) if text.is_empty() => DASH.into(),
        Value::String(text) => escape(text),
        Value::Array(all) if all.iter().all(Value::is_string) => all.iter().map(any).collect::<Vec<_>>().join(" "),
        Value::Object(fields) if fields.is_empty() => DASH.into(),
        Value::Object(fields) => {
            let named =
                fields.iter().map(|(name, field)| format!("{} {}", escape(&name.replace('_', " ")), any(field)));
            named.collect::<Vec<_>>().join(", ")
        }
        other => escape(&other.to_string()),
    }
}

/// Appends nested objects to `out` as (dotted name, value), in their own order; an object of plain values is one entry.
pub fn leaves<'a>(prefix: &str, value: &'a Value, out: &mut Vec<(String, &'a Value)>) {
    match value {
        Value::Object(fields) if prefix.is_empty() || fields.values().any(Value::is_object) => {
            for (name, field) in fields {
                let dotted = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
                leaves(&dotted, field, out);
            }
        }
        leaf => out.push((prefix.into(), leaf)),
    }
}

/// Makes a table; on a narrow page its rows become blocks of headings and values. Headings are text; cells are HTML
/// already.
pub fn table(headings: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let headings: Vec<String> = headings.iter().map(|heading| escape(heading)).collect();
    let head = |heading: &String| format!("<th scope=\"col\">{heading}</th>");
    let head: String = headings.iter().map(head).collect();
    let cell = |(i, cell): (usize, String)| {
        format!("<td data-label=\"{}\">{cell}</td>", headings.get(i).map_or("", String::as_str))
    };
    let row = |row: Vec<String>| format!("<tr>{}</tr>", row.into_iter().enumerate().map(cell).collect::<String>());
    let body: String = rows.into_iter().map(row).collect();
    format!("<div class=\"table\"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>")
}

/// Makes a list of names beside values; both are HTML already.
pub fn list(items: impl IntoIterator<Item = (String, String)>) -> String {
    let item = |(name, value): (String, String)| format!("<div><dt>{name}</dt><dd>{value}</dd></div>");
    format!("<dl>{}</dl>", items.into_iter().map(item).collect::<String>())
}

/// Makes a verdict with a style of its own; the style adds a sign, so that no verdict is told by colour alone.
pub fn verdict(word: &str) -> String {
    format!("<span class=\"verdict {}\">{word}</span>", word.replace(' ', "-"))
}

/// Makes a whole page, with the scripts that its time plots need. The title is text; the body is HTML already.
pub fn page(title: &str, style: &str, body: &str) -> String {
    let (plot_style, scripts) = if body.contains("class=\"time-plots\"") {
        (UPLOT_STYLE, format!("<script>{}</script>", SCRIPTS.join("\n")))
    } else {
        ("", String::new())
    };
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>{}</title>\
         <link rel=\"icon\" href=\"data:,\"><style>{plot_style}{style}</style></head>\n\
         <body><main>{body}</main>{scripts}</body></html>\n",
        escape(title)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn markup_becomes_text() {
        assert_eq!(escape(r#"<b a="1">'&'</b>"#), "&lt;b a=&quot;1&quot;&gt;&#39;&amp;&#39;&lt;/b&gt;");
        assert_eq!(any(&json!({ "<k>": 1 })), "&lt;k&gt; 1");
    }

    #[test]
    fn a_path_may_be_broken_and_a_range_of_numbers_may_not() {
        assert_eq!(breakable("runs/a_b, 7-9 <x>, a-9"), "runs/<wbr>a_<wbr>b, 7-\u{2060}9 &lt;x&gt;, a-9");
        assert_eq!(any(&json!(["fly", "<x>"])), "fly &lt;x&gt;");
    }

    #[test]
    fn leaves_are_named_by_their_path() {
        let value = json!({ "a": { "b": { "x": 1, "y": "z" }, "c": [2] }, "d": null });
        let mut out = Vec::new();
        leaves("", &value, &mut out);
        let names: Vec<_> = out.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["a.b", "a.c", "d"]);
        assert_eq!(any(out[0].1), "x 1, y z");
    }
}
