//! Sizes of a model, and how fields are packed in flat arrays.

use crate::Field::{self, Multipliers};
use crate::{FIELDS, FieldSet, ModelInfo, Query, Rows};

/// The sizes of a model that fix the shape of every field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "transport", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Sizes {
    /// Tree coordinates.
    pub n_q: usize,
    /// Tree velocities.
    pub n_v: usize,
    /// Independent coordinates.
    pub n_qy: usize,
    /// Independent velocities.
    pub n_vy: usize,
    /// Actuators.
    pub n_u: usize,
    /// Constraint rows.
    pub n_c: usize,
    /// Clusters with loops that are not pure couplings.
    pub n_branches: usize,
    /// Moving bodies, one for each joint of the tree.
    #[cfg_attr(feature = "transport", serde(default))]
    pub n_bodies: usize,
    /// Cuts of loops, without couplings.
    #[cfg_attr(feature = "transport", serde(default))]
    pub n_cuts: usize,
}

impl Sizes {
    /// Parameters in which forces are linear: see [`ModelInfo::parameters`].
    pub const fn n_parameters(&self) -> usize {
        10 * self.n_bodies + 3 * self.n_v
    }

    /// Numbers of the geometry: see [`ModelInfo::geometry`].
    pub const fn n_geometry(&self) -> usize {
        6 * self.n_bodies + 12 * self.n_cuts
    }
}

/// The slot of one field in the packed numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The field.
    pub field: Field,
    /// Index of its first number.
    pub offset: usize,
    /// Rows.
    pub rows: usize,
    /// Columns; a matrix is packed row by row.
    pub columns: usize,
}

impl Slot {
    /// The number of values in this slot.
    pub const fn range(&self) -> core::ops::Range<usize> {
        self.offset..self.offset + self.rows * self.columns
    }

    /// True for lists of rows, be they of one number.
    pub fn is_matrix(&self) -> bool {
        let has_rows = FIELDS[self.field as usize].shape.contains(" × ");
        self.columns > 1 || has_rows && !self.field.is_second()
    }
}

/// The layout of a set of fields in one flat array, in the order of the field numbers.
///
/// The plan fixes every place. A field whose number of rows depends on the state has the largest
/// number in its slot; rows that an answer does not have are NaN and come last.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    slots: Vec<Slot>,
    len: usize,
    /// Index of each field among the slots, by field number; [`ABSENT`] if it is not in the set.
    index: [u8; Field::ALL.len()],
}

const ABSENT: u8 = u8::MAX;

impl Layout {
    /// The layout of the fields that a request gives.
    pub fn of_given(query: &Query, sizes: &Sizes) -> Layout {
        Layout::pack(query.given, query, sizes, sizes)
    }

    /// The layout of an answer's fields, with the rows of the joints that the query picks.
    pub fn of_want(query: &Query, model: &ModelInfo) -> Layout {
        if query.joint_runs().is_empty() {
            return Layout::pack(query.want, query, &model.sizes, &model.sizes);
        }
        Layout::of_rows(query, model, &Rows::of(query, model))
    }

    /// The layout of an answer for rows that are already known.
    pub fn of_rows(query: &Query, model: &ModelInfo, rows: &Rows) -> Layout {
        Layout::pack(query.want, query, &model.sizes, &rows.sizes(model))
    }

    /// The fields and their slots.
    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }

    /// The slot of one field, if present.
    #[inline]
    pub fn slot(&self, field: Field) -> Option<&Slot> {
        self.slots.get(self.index[field as usize] as usize)
    }

    /// The length of the array.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True if the layout is empty.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    fn pack(set: FieldSet, query: &Query, sizes: &Sizes, picked: &Sizes) -> Layout {
        let mut len = 0;
        let mut index = [ABSENT; Field::ALL.len()];
        let n_frames = query.n_frames as usize;
        let n_wrenches = query.n_wrenches as usize;
        let slots = set
            .iter()
            .enumerate()
            .map(|(k, field)| {
                index[field as usize] = k as u8;
                let (rows, columns) = field.shape_of_rows(sizes, picked, n_frames, n_wrenches);
                let each = if field.has_direction_rows() { query.n_directions as usize } else { 1 };
                let [rows, columns] = match field.is_second() && query.given.has(Multipliers) {
                    true => [columns, 1],
                    false => [rows * each, columns],
                };
                let slot = Slot { field, offset: len, rows, columns };
                len += rows * columns;
                slot
            })
            .collect();
        Layout { slots, len, index }
    }
}
