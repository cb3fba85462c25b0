use super::*;

/// Every field and every variant with fields, filled with values that are all different.
fn everything() -> Description {
    let placement = |x: f64| Placement { xyz: [x, x + 0.1, x + 0.2], rpy: [-x, 0.3 - x, 0.0] };
    let link = |name: &str, inertial| Link { name: name.into(), inertial };
    let joint = |name: &str, kind, parent: usize, limits, coupling| Joint {
        name: name.into(),
        kind,
        parent,
        child: parent + 1,
        origin: placement(1.0 + parent as f64),
        axis: [0.0, 0.6, 0.8],
        limits,
        coupling,
        terms: Terms {
            damping: 0.5,
            stiffness: 20.0,
            rest: 0.1,
            friction: Friction { coulomb: 0.6, viscous: 0.06, speed: 0.02 },
            ..Terms::default()
        },
        motor: Some(Motor {
            continuous: 3.0,
            thermal_time: 60.0,
            series_stiffness: 350.0,
            driving: vec![[30.0, 25.0], [40.0, 0.0]],
            braking: vec![[31.0, 32.0]],
            power: 500.0,
            efficiency: [0.9, 0.8],
        }),
    };
    let inertial =
        Inertial { origin: placement(3.0), mass: 1.5, inertia: [1.0, 0.01, 0.02, 1.1, 0.03, 1.2] };
    let limits = Limits { lower: -1.0, upper: 2.0, velocity: 3.0, effort: f64::INFINITY };
    let line = Curve::Polynomial { about: 0.125, coefficients: vec![0.5, -0.25] };
    let table = Curve::Table(vec![[0.0, 1.0], [1.0, 3.0], [2.0, 4.0]]);
    let coupling = Coupling {
        terms: vec![(0, 2.0), (1, -0.5)],
        offset: 0.25,
        curves: vec![(0, line), (1, table)],
    };
    let row = |name: &str, against| Row {
        name: name.into(),
        axis: [1.0, 0.0, 0.0, 0.0, 2.0, 3.0],
        against,
    };
    let cut =
        |name: &str, cut, rows| Loop { name: name.into(), predecessor: 0, successor: 2, cut, rows };
    let placed = Cut::Placed { predecessor: placement(5.0), successor: placement(6.0) };
    Description {
        name: "röbot".into(),
        links: vec![link("base", None), link("rod", Some(inertial)), link("tip", None)],
        joints: vec![
            joint("hip", JointKind::Revolute, 0, Some(limits), None),
            joint("knee", JointKind::Prismatic, 1, None, Some(coupling)),
        ],
        submechanisms: vec![
            Submechanism {
                name: "leg".into(),
                kind: SubmechanismKind::Rrpr,
                type_name: "RRPR".into(),
                spanning_tree: vec![0, 1],
                independent: vec![0, 1],
                active: vec![1, 0],
                loops: vec![
                    cut(
                        "a",
                        Cut::AtJoint(1),
                        vec![row("x", None), row("y", Some([0.0, 1.0, 2.0]))],
                    ),
                    cut("b", Cut::AtLink(2), vec![]),
                    cut("c", placed, vec![row("z", None)]),
                ],
                closed_forms: true,
            },
            Submechanism {
                name: "arm".into(),
                kind: SubmechanismKind::Serial,
                type_name: "R".into(),
                spanning_tree: vec![],
                independent: vec![],
                active: vec![],
                loops: vec![],
                closed_forms: true,
            },
        ],
        gravity: [0.0, 0.0, -9.81],
        zero_pose: Vec::new(),
    }
}

/// Every text, number and index of a description.
#[derive(Default)]
struct Leaves<'a> {
    texts: Vec<&'a mut String>,
    numbers: Vec<&'a mut f64>,
    indices: Vec<&'a mut usize>,
}

impl<'a> Leaves<'a> {
    fn of(description: &'a mut Description) -> Leaves<'a> {
        let mut leaves = Leaves::default();
        let Description { name, links, joints, submechanisms, gravity, zero_pose } = description;
        leaves.texts.push(name);
        leaves.numbers.extend(gravity);
        for (joint, coordinates) in zero_pose {
            leaves.indices.push(joint);
            leaves.numbers.extend(coordinates);
        }
        for Link { name, inertial } in links {
            leaves.texts.push(name);
            if let Some(Inertial { origin, mass, inertia }) = inertial {
                leaves.placement(origin);
                leaves.numbers.push(mass);
                leaves.numbers.extend(inertia);
            }
        }
        for joint in joints {
            let Joint {
                name,
                kind: _,
                parent,
                child,
                origin,
                axis,
                limits,
                coupling,
                terms,
                motor,
            } = joint;
            leaves.texts.push(name);
            leaves.indices.extend([parent, child]);
            leaves.placement(origin);
            leaves.numbers.extend(axis);
            if let Some(Limits { lower, upper, velocity, effort }) = limits {
                leaves.numbers.extend([lower, upper, velocity, effort]);
            }
            if let Some(Coupling { terms, offset, curves }) = coupling {
                leaves.numbers.push(offset);
                for (joint, multiplier) in terms {
                    leaves.indices.push(joint);
                    leaves.numbers.push(multiplier);
                }
                for (joint, curve) in curves {
                    leaves.indices.push(joint);
                    match curve {
                        Curve::Polynomial { about, coefficients } => {
                            leaves.numbers.push(about);
                            leaves.numbers.extend(coefficients);
                        }
                        Curve::Table(points) => {
                            leaves.numbers.extend(points.as_flattened_mut().iter_mut());
                        }
                    }
                }
            }
            let Terms { damping, stiffness, rest, rotor_inertia, gear_ratio, friction } = terms;
            leaves.numbers.extend([damping, stiffness, rest, rotor_inertia, gear_ratio]);
            let Friction { coulomb, viscous, speed } = friction;
            leaves.numbers.extend([coulomb, viscous, speed]);
            if let Some(motor) = motor {
                let Motor { continuous, thermal_time, series_stiffness, power, .. } = motor;
                leaves.numbers.extend([continuous, power, thermal_time, series_stiffness]);
                let Motor { driving, braking, efficiency, .. } = motor;
                leaves.numbers.extend(efficiency);
                leaves.numbers.extend(driving.as_flattened_mut().iter_mut());
                leaves.numbers.extend(braking.as_flattened_mut().iter_mut());
            }
        }
        for submechanism in submechanisms {
            let Submechanism {
                name,
                kind: _,
                type_name,
                spanning_tree,
                independent,
                active,
                loops,
                closed_forms: _,
            } = submechanism;
            leaves.texts.extend([name, type_name]);
            leaves.indices.extend(spanning_tree);
            leaves.indices.extend(independent);
            leaves.indices.extend(active);
            for Loop { name, predecessor, successor, cut, rows } in loops {
                leaves.texts.push(name);
                leaves.indices.extend([predecessor, successor]);
                match cut {
                    Cut::AtJoint(index) | Cut::AtLink(index) => leaves.indices.push(index),
                    Cut::Placed { predecessor, successor } => {
                        leaves.placement(predecessor);
                        leaves.placement(successor);
                    }
                }
                for Row { name, axis, against } in rows {
                    leaves.texts.push(name);
                    leaves.numbers.extend(axis);
                    leaves.numbers.extend(against.iter_mut().flatten());
                }
            }
        }
        leaves
    }

    fn placement(&mut self, Placement { xyz, rpy }: &'a mut Placement) {
        self.numbers.extend(xyz);
        self.numbers.extend(rpy);
    }
}

/// The fingerprint after a change.
fn after(change: impl FnOnce(&mut Description)) -> u64 {
    let mut description = everything();
    change(&mut description);
    description.fingerprint()
}

#[test]
fn the_fingerprint_of_a_description_made_by_hand_is_this_number() {
    // published vectors of FNV-1a 64
    assert_eq!(fnv1a_64(b""), 0xcbf2_9ce4_8422_2325);
    assert_eq!(fnv1a_64(b"a"), 0xaf63_dc4c_8601_ec8c);
    assert_eq!(fnv1a_64(b"foobar"), 0x8594_4171_f739_67e8);

    let bytes = everything().canonical_bytes();
    // version, length of the name, the name in UTF-8, number of links
    assert_eq!(bytes[..9], [1, 6, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bytes[9..15], *"röbot".as_bytes());
    assert_eq!(bytes[15..23], 3_u64.to_le_bytes());
    assert_eq!(bytes[bytes.len() - 8..], (-9.81_f64).to_bits().to_le_bytes());
    assert_eq!((bytes.len(), everything().fingerprint()), (1506, 0x62a4_fc45_12c0_824b));
    // a robot without curves has the fingerprint that it had before there were any
    let mut plain = everything();
    plain.joints.iter_mut().filter_map(|of| of.coupling.as_mut()).for_each(|of| of.curves.clear());
    assert_eq!((plain.canonical_bytes().len(), plain.fingerprint()), (1410, 0xdb51_4d42_b3c7_98d6));
}

#[test]
fn changing_any_name_number_or_index_changes_the_fingerprint() {
    let mut description = everything();
    let original = description.fingerprint();
    let counts = {
        let leaves = Leaves::of(&mut description);
        [leaves.texts.len(), leaves.numbers.len(), leaves.indices.len()]
    };
    let mut seen = vec![original];
    for k in 0..counts[0] {
        seen.push(after(|description| Leaves::of(description).texts[k].push('x')));
    }
    for k in 0..counts[1] {
        // the next number
        let next = |number: f64| f64::from_bits(number.to_bits() ^ 1);
        seen.push(after(|description| {
            let number = &mut *Leaves::of(description).numbers.swap_remove(k);
            *number = next(*number);
        }));
    }
    for k in 0..counts[2] {
        seen.push(after(|description| *Leaves::of(description).indices[k] += 7));
    }
    assert_eq!(counts, [16, 123, 22]);
    let n = seen.len();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), n);
}

#[test]
fn changing_any_order_variant_or_presence_changes_the_fingerprint() {
    use SubmechanismKind as S;
    let mut seen = vec![
        after(|_| {}),
        after(|d| d.links.swap(0, 1)),
        after(|d| d.joints.swap(0, 1)),
        after(|d| d.submechanisms.swap(0, 1)),
        after(|d| d.gravity.swap(0, 2)),
        after(|d| d.joints[1].coupling.as_mut().unwrap().terms.swap(0, 1)),
        after(|d| d.submechanisms[0].spanning_tree.swap(0, 1)),
        after(|d| d.submechanisms[0].independent.swap(0, 1)),
        after(|d| d.submechanisms[0].active.swap(0, 1)),
        after(|d| d.submechanisms[0].loops.swap(0, 1)),
        after(|d| d.submechanisms[0].loops[0].rows.swap(0, 1)),
        // the same entries in another list
        after(|d| {
            let joint = d.submechanisms[0].spanning_tree.remove(1);
            d.submechanisms[0].independent.insert(0, joint);
        }),
        after(|d| {
            let row = d.submechanisms[0].loops[0].rows.remove(1);
            d.submechanisms[0].loops[1].rows.push(row);
        }),
        // the same letters in another name
        after(|d| (d.links[0].name, d.links[1].name) = ("baser".into(), "od".into())),
        after(|d| d.links[1].inertial = None),
        after(|d| d.joints[0].limits = None),
        after(|d| d.joints[1].coupling = None),
        after(|d| d.submechanisms[0].loops[0].rows[1].against = None),
        after(|d| d.submechanisms[0].loops[0].cut = Cut::AtLink(1)),
        after(|d| d.zero_pose = vec![(1, vec![0.25])]),
        after(|d| d.zero_pose = vec![(0, vec![0.25])]),
        after(|d| d.zero_pose = vec![(1, vec![0.5])]),
        after(|d| d.zero_pose = vec![(1, vec![0.25, 0.0])]),
        after(|d| d.zero_pose = vec![(1, vec![0.25]), (0, vec![0.0])]),
    ];
    for kind in [
        JointKind::Fixed,
        JointKind::Continuous,
        JointKind::Prismatic,
        JointKind::Spherical,
        JointKind::Floating,
    ] {
        seen.push(after(|d| d.joints[0].kind = kind));
    }
    for kind in [
        S::Serial,
        S::Spu2U1,
        S::Sprr2U1,
        S::Surrpr2U1,
        S::Ups6,
        S::Rus3x2,
        S::ParallelogramChain,
        S::Transmission,
        S::FourBar,
        S::SliderCrank,
        S::Differential,
        S::Numerical,
    ] {
        seen.push(after(|d| d.submechanisms[0].kind = kind));
    }
    let n = seen.len();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), n);
}

#[test]
fn zero_of_either_sign_is_one_number() {
    assert_eq!(after(|d| d.gravity[0] = -0.0), everything().fingerprint());
}
