//! How the time of a frame grows: with the number of Gaussians, with the pixels, and from one eye to both.

use super::measure::{print_table, short_count};
use super::row::{Row, title};

/// Prints what follows from the rows of the standard table.
pub(crate) fn print(rows: &[Row]) {
    let formats: Vec<&[Row]> = rows.chunk_by(|a, b| format(a) == format(b)).collect();
    with_count(&formats);
    with_pixels(&formats);
}

fn format(row: &Row) -> (u32, u32, u32) {
    (row.width, row.height, row.views)
}

/// What three times the Gaussians would cost, if time grew on as between two rows.
fn for_thrice(gaussians: f64, time: f64) -> f64 {
    time.powf(3.0f64.ln() / gaussians.ln())
}

fn with_count(formats: &[&[Row]]) {
    println!("\nTime for more Gaussians; in brackets, for three times as many at that rate\n");
    let titles: Vec<String> = formats
        .iter()
        .filter_map(|rows| rows.first())
        .map(|row| title(row.width, row.height, row.views))
        .collect();
    let mut headings = vec!["Gaussians"];
    headings.extend(titles.iter().map(String::as_str));
    let steps = formats
        .first()
        .map_or(0, |rows| rows.len().saturating_sub(1));
    let table: Vec<Vec<String>> = (0..steps)
        .map(|step| {
            let pairs = formats
                .iter()
                .filter_map(|rows| rows.get(step).zip(rows.get(step + 1)));
            let mut label = String::new();
            let cells: Vec<String> = pairs
                .map(|(less, more)| {
                    let count = more.gaussians as f64 / less.gaussians as f64;
                    let time = more.medians.total_ms / less.medians.total_ms;
                    label = format!(
                        "{} to {}: {count:.2}x",
                        short_count(less.gaussians),
                        short_count(more.gaussians)
                    );
                    format!("{time:.2}x ({:.2}x)", for_thrice(count, time))
                })
                .collect();
            std::iter::once(label).chain(cells).collect()
        })
        .collect();
    print_table(&headings, &table);
}

fn with_pixels(formats: &[&[Row]]) {
    println!("\nTime for more pixels, and for a second eye\n");
    let steps: Vec<(&[Row], &[Row])> = formats
        .windows(2)
        .filter_map(|pair| match pair {
            [less, more] => Some((*less, *more)),
            _ => None,
        })
        .collect();
    let labels: Vec<String> = steps
        .iter()
        .filter_map(|(less, more)| less.first().zip(more.first()))
        .map(|(less, more)| {
            let pixels =
                |row: &Row| f64::from(row.width) * f64::from(row.height) * f64::from(row.views);
            let names = [less, more]
                .map(|row| title(row.width, row.height, row.views))
                .join(" to ");
            format!("{names}: {:.2}x", pixels(more) / pixels(less))
        })
        .collect();
    let mut headings = vec!["Gaussians"];
    headings.extend(labels.iter().map(String::as_str));
    let counts = formats.first().copied().unwrap_or_default();
    let table: Vec<Vec<String>> = counts
        .iter()
        .enumerate()
        .map(|(at, row)| {
            let cells = steps.iter().filter_map(|(less, more)| {
                let (less, more) = less.get(at).zip(more.get(at))?;
                Some(format!(
                    "{:.2}x",
                    more.medians.total_ms / less.medians.total_ms
                ))
            });
            std::iter::once(short_count(row.gaussians))
                .chain(cells)
                .collect()
        })
        .collect();
    print_table(&headings, &table);
}

#[cfg(test)]
mod tests {
    use super::for_thrice;

    #[test]
    fn time_that_grows_with_the_count_triples_for_thrice_as_many() {
        assert!((for_thrice(2.0, 2.0) - 3.0).abs() < 1e-9, "in proportion");
        assert!(
            (for_thrice(4.0, 2.0) - 3.0f64.sqrt()).abs() < 1e-9,
            "by its root"
        );
    }
}
