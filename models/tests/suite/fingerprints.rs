//! The fingerprints of the bundled robots: what clients, configurations and logs have in hand.

use sarrus_models::bundled;

use super::*;

const FINGERPRINTS: &[(&str, u64)] = &[];

#[test]
fn every_bundled_robot_keeps_its_fingerprint() {
    let found: Vec<(&str, u64)> = bundled()
        .map(|(name, _)| {
            let loaded = load(&Source::Bundled(name.into()), &Options::default())
                .unwrap_or_else(|error| panic!("{error}"));
            (name, loaded.compiled.model.fingerprint())
        })
        .collect();
    assert_eq!(found, FINGERPRINTS, "{found:#018x?}");
}
