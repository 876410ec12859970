//! Charts of lines, as SVG that any browser shows, on white. Text is left to the reader's fonts, so that the files depend on
//! no machine.

use super::axis::Axis;
use anyhow::Result;
use plotters::prelude::*;

/// Pixels of the file; twice what a page shows, as coordinates are whole pixels.
const SIZE: (u32, u32) = (1600, 1000);
const TITLE: i32 = 36;
const TEXT: i32 = 28;
/// From one line of the legend to the next.
const LEGEND_STEP: i32 = 38;
const MARGIN: i32 = 24;

/// Told apart with any colour vision: Okabe and Ito 2008, "Color Universal Design", without its yellow; black comes first.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

/// One line of a chart.
pub(crate) struct Line {
    pub(crate) label: String,
    /// In the order drawn; the line is broken where points lie outside the axes.
    pub(crate) points: Vec<(f64, f64)>,
}

/// Lines over one pair of axes, their legend above.
pub(crate) struct Chart {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) lines: Vec<Line>,
}

impl Chart {
    pub(crate) fn svg(&self) -> Result<String> {
        let mut svg = String::new();
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let legend = 2 * MARGIN + TITLE + LEGEND_STEP * self.lines.len() as i32;
        let (head, body) = root.split_vertically(legend);
        let text = ("sans-serif", TEXT).into_font();
        head.draw_text(
            &self.title,
            &("sans-serif", TITLE).into_font().color(&BLACK),
            (MARGIN, MARGIN),
        )?;
        let mut chart = ChartBuilder::on(&body)
            .margin(MARGIN)
            .x_label_area_size(3 * TEXT)
            .y_label_area_size(4 * TEXT)
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        chart
            .configure_mesh()
            .x_desc(self.x.label)
            .y_desc(self.y.label)
            .x_labels(11)
            .y_labels(8)
            .bold_line_style(BLACK.mix(0.15))
            .light_line_style(TRANSPARENT)
            .label_style(text.clone())
            .axis_desc_style(text.clone())
            .draw()?;
        for (i, line) in self.lines.iter().enumerate() {
            // Each thinner than the one beneath, which stays in sight where they coincide.
            let width = 3 + 2 * (self.lines.len() - 1 - i) as u32;
            let style = COLOURS[i % COLOURS.len()].stroke_width(width);
            let y = 2 * MARGIN + TITLE + LEGEND_STEP * i as i32;
            head.draw(&PathElement::new(
                [(MARGIN, y + TEXT / 2), (MARGIN + 3 * TEXT, y + TEXT / 2)],
                style,
            ))?;
            let label = text.clone().color(&BLACK);
            head.draw_text(&line.label, &label, (2 * MARGIN + 3 * TEXT, y))?;
            let is_inside = |(x, y): &(f64, f64)| {
                (self.x.range.start..=self.x.range.end).contains(x)
                    && (self.y.range.start..=self.y.range.end).contains(y)
            };
            for piece in line.points.split(|point| !is_inside(point)) {
                chart.draw_series(LineSeries::new(piece.iter().copied(), style))?;
            }
        }
        root.present()?;
        drop(chart);
        drop((head, body, root));
        Ok(svg)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::super::axis::Scale;
    use super::*;

    #[test]
    fn a_line_is_broken_where_it_leaves_the_axes() {
        let axis = |label, scale| Axis {
            label,
            range: 1.0..10.0,
            scale,
        };
        let chart = Chart {
            title: "a title".to_owned(),
            x: axis("length (m)", Scale::Linear),
            y: axis("error", Scale::Log),
            lines: vec![Line {
                label: "a line".to_owned(),
                points: [1.0, 2.0, f64::INFINITY, 3.0, 11.0, 5.0, 10.0]
                    .into_iter()
                    .enumerate()
                    .map(|(i, y)| (1.0 + i as f64, y))
                    .collect(),
            }],
        };
        let svg = chart.svg().unwrap();
        for text in ["a title", "length (m)", "error", "a line"] {
            assert!(svg.contains(text), "{text}");
        }
        // Three pieces, the middle one of a single point, and the line in the legend.
        assert_eq!(svg.matches("stroke-width=\"3\"").count(), 4);
        assert_eq!(chart.svg().unwrap(), svg);
    }
}
