//! Writes the sums over all links.

use sarrus_proto::{Field, Status};

use crate::algorithms::{self, Links};
use crate::model::Model;
use crate::scalar::Real;
use crate::workspace::Workspace;

/// Writes a field of [`crate::plan::needed::OF_THE_LINKS`]; `bodies` are all of them. Needs their
/// poses in the root, their velocities, G and g, each where the field reads it.
pub(super) fn write<T: Real>(
    model: &Model<T>,
    ws: &mut Workspace<T>,
    bodies: &[usize],
    field: Field,
    out: &mut [T],
) -> Result<(), Status> {
    if field == Field::ComBias {
        algorithms::rates(model, bodies, &ws.qd, &ws.g, &mut ws.motion);
    }
    let links = Links::of(model, &ws.world, &ws.motion);
    // a robot without mass has no centre of it
    if field != Field::Energy && !T::ZERO.lt(links.mass) {
        return Err(Status::MassNotPositive);
    }
    match field {
        Field::Com => out.copy_from_slice(links.com().as_slice()),
        Field::ComBias => out.copy_from_slice(links.com_bias().as_slice()),
        Field::Momentum => out.copy_from_slice(&links.momentum()),
        Field::Energy => out.copy_from_slice(&links.energy(&ws.q, &ws.qd)),
        Field::Centroidal => {
            out.fill(T::ZERO);
            links.columns(&mut ws.composite, |v, column| add_column(model, &ws.G, v, column, out));
        }
        Field::ComJacobian => {
            out.fill(T::ZERO);
            let mass = links.mass;
            links.columns(&mut ws.composite, |v, column| {
                let velocity = [column[3], column[4], column[5]].map(|x| x / mass);
                add_column(model, &ws.G, v, &velocity, out);
            });
        }
        _ => {}
    }
    Ok(())
}

/// Adds the column of a tree velocity, times its row of G, to a matrix over the independents.
fn add_column<T: Real>(model: &Model<T>, G: &[T], v: usize, column: &[T], out: &mut [T]) {
    let n = model.sizes().n_vy;
    let cluster = &model.clusters[model.cluster_of_v[v]];
    for (k, g) in cluster.independents().zip(cluster.G(G).row(v - cluster.v)) {
        let k = model.order.vy_external[k];
        for (row, x) in column.iter().enumerate() {
            let entry = &mut out[row * n + k];
            *entry = x.mul_add(*g, *entry);
        }
    }
}
