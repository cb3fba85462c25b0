//! The table of the fields of requests and answers, for `ask --fields`, `ask --help` and the
//! manual.

use sarrus_proto::FIELDS;

use crate::commands::output::table;

/// Sizes and conventions that the rows of the table use.
const HEAD: &str = "\
Fields: vectors are lists, matrices lists of rows. n_q, n_v: tree coordinates and velocities; n_qy,
n_vy: independent ones; n_u: actuators; n_c: loop rows; `sarrus check` prints the names in order.
Quaternions are x, y, z, w; twists and wrenches have the angular part first. `frames` in a line of
`ask` holds `p`, `quat`, `twist` and `acc` of each frame.

";

/// One row for each field.
pub(super) fn table_in_words() -> String {
    let rows: Vec<Vec<String>> = FIELDS
        .iter()
        .map(|entry| {
            [entry.field.name(), entry.shape, entry.unit, entry.meaning].map(str::to_owned).into()
        })
        .collect();
    HEAD.to_owned() + &table("name | shape | unit | meaning", &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_has_a_row_with_its_shape_and_meaning() {
        let text = table_in_words();
        for entry in FIELDS {
            let row = text.lines().find(|line| {
                line.split_whitespace().next() == Some(entry.field.name())
                    && line.ends_with(entry.meaning)
            });
            assert!(row.is_some_and(|row| row.contains(entry.shape)), "{}", entry.field.name());
        }
    }
}
