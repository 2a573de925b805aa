//! Writes SVG as text, with the few shapes that the pictures need.

use std::fmt::Write;

/// Which point of a text is at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The beginning.
    Start,
    /// The middle.
    Middle,
    /// The end.
    End,
}

/// A place on the canvas, pixels from the upper left corner.
pub type Place = (f64, f64);

/// A rectangle on the canvas, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// The left edge.
    pub left: f64,
    /// The upper edge.
    pub top: f64,
    /// The width.
    pub width: f64,
    /// The height.
    pub height: f64,
}

impl Area {
    /// The right edge.
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    /// The lower edge.
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

/// A picture under construction.
pub struct Canvas {
    text: String,
}

impl Canvas {
    /// A white canvas.
    pub fn new(width: f64, height: f64, title: &str) -> Self {
        let mut canvas = Self { text: String::new() };
        canvas.put(&format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
             font-family=\"Helvetica, Arial, 'DejaVu Sans', sans-serif\" font-size=\"12\">"
        ));
        canvas.put(&format!("<title>{}</title>", escape(title)));
        canvas.put(&format!("<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>"));
        canvas
    }

    fn put(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// Begins a group of shapes that belong together.
    pub fn begin_group(&mut self, class: &str) {
        self.put(&format!("<g class=\"{class}\">"));
    }

    /// Ends the group.
    pub fn end_group(&mut self) {
        self.put("</g>");
    }

    /// Draws a straight line; `style` has SVG attributes.
    pub fn line(&mut self, from: Place, to: Place, style: &str) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(number);
        self.put(&format!("<line x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\" {style}/>"));
    }

    /// Draws a line through many places.
    pub fn polyline(&mut self, places: &[Place], style: &str) {
        let mut points = String::new();
        for (x, y) in places {
            let blank = if points.is_empty() { "" } else { " " };
            let _ = write!(points, "{blank}{},{}", number(*x), number(*y));
        }
        self.put(&format!("<polyline points=\"{points}\" fill=\"none\" {style}/>"));
    }

    /// Draws a rectangle, empty or filled as `style` says.
    pub fn rectangle(&mut self, area: Area, style: &str) {
        let [x, y, width, height] = [area.left, area.top, area.width, area.height].map(number);
        self.put(&format!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" {style}/>"));
    }

    /// Draws a circle.
    pub fn circle(&mut self, (x, y): Place, radius: f64, style: &str) {
        let [x, y] = [x, y].map(number);
        self.put(&format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" {style}/>"));
    }

    /// Draws a text.
    pub fn text(&mut self, (x, y): Place, anchor: Anchor, text: &str, style: &str) {
        let [x, y] = [x, y].map(number);
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let blank = if style.is_empty() { "" } else { " " };
        self.put(&format!("<text x=\"{x}\" y=\"{y}\"{anchor}{blank}{style}>{}</text>", escape(text)));
    }

    /// Draws a text along a vertical axis, read from below.
    pub fn upright_text(&mut self, (x, y): Place, text: &str, style: &str) {
        let [x, y] = [x, y].map(number);
        self.put(&format!(
            "<text transform=\"translate({x} {y}) rotate(-90)\" text-anchor=\"middle\" {style}>{}</text>",
            escape(text)
        ));
    }

    /// Returns the whole file.
    pub fn finish(mut self) -> String {
        self.put("</svg>");
        self.text
    }
}

/// A coordinate with one decimal and without a sign on zero. A tenth of a pixel is not visible.
fn number(value: f64) -> String {
    let text = format!("{value:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Escapes a text for XML. A character that XML does not allow becomes a replacement character.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\u{FFFE}' | '\u{FFFF}' => escaped.push('\u{FFFD}'),
            c if c.is_control() => escaped.push('\u{FFFD}'),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_cannot_break_out_of_the_file() {
        assert_eq!(escape("a<b>&\"c\"\u{1b}"), "a&lt;b&gt;&amp;&quot;c&quot;\u{FFFD}");
    }

    #[test]
    fn coordinates_are_short() {
        assert_eq!([number(1.0), number(-0.04), number(12.345)], ["1", "0", "12.3"]);
    }
}
