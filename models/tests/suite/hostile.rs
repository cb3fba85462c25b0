//! Files that mean harm, and files that were damaged: reported or read, never a panic, never a
//! wait.

use super::*;

/// Pseudo-random numbers (SplitMix64) of a fixed seed.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }
}

#[test]
fn deep_nesting_is_refused_before_a_parser_sees_it() {
    let urdf = format!("<robot name=\"r\">{}", "<link>".repeat(1_000_000));
    let expected = "robot.urdf:1:395: elements are nested too deep, expected at most 64 levels, \
        flatten the file\n";
    assert_eq!(reported_of(urdf.as_bytes(), None, false), expected);
    for (yaml, expected) in [
        (
            "[".repeat(1_000_000),
            "submechanisms.yml:1:256: lists and mappings are nested too deep, expected at most 64 \
             levels, flatten the file\n",
        ),
        (
            "- ".repeat(1_000_000),
            "submechanisms.yml:1:129: lists and mappings are nested too deep, expected at most 64 \
             levels, flatten the file\n",
        ),
        (
            "{a: ".repeat(1_000_000),
            "submechanisms.yml:1:1021: lists and mappings are nested too deep, expected at most 64 \
             levels, flatten the file\n",
        ),
        (
            "? ".repeat(1_000_000),
            "submechanisms.yml:1:129: lists and mappings are nested too deep, expected at most 64 \
             levels, flatten the file\n",
        ),
    ] {
        assert_eq!(reported_of(URDF.as_bytes(), Some(yaml.as_bytes()), false), expected);
    }
    let levels = format!(
        "<robot name=\"r\"><link name=\"a\">{}{}</link></robot>",
        "<visual>".repeat(62),
        "</visual>".repeat(62)
    );
    assert_eq!(reported_of(levels.as_bytes(), None, false), "");
}

#[test]
fn a_bomb_of_entities_is_refused() {
    let bomb = "<?xml version=\"1.0\"?>\n<!DOCTYPE lolz [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY \
        b \"&a;&a;&a;&a;&a;\">]>\n<robot name=\"&b;\"/>";
    let expected = "robot.urdf:2:1: a document type declaration (DTD), expected a file without \
        one, remove it; the five entities of XML itself need none\n";
    assert_eq!(reported_of(bomb.as_bytes(), None, false), expected);
}

#[test]
fn aliases_are_expanded_up_to_a_bound() {
    // level k stands for 10^k values and the lists around them
    let bomb = |levels: usize| {
        let level =
            |k: usize| format!("a{k}: &a{k} [{}]\n", vec![format!("*a{}", k - 1); 10].join(", "));
        let first = "a0: &a0 x\n".to_owned();
        first + &(1..=levels).map(level).collect::<String>()
    };
    let reported = |yaml: &str| reported_of(URDF.as_bytes(), Some(yaml.as_bytes()), false);
    let expected = "submechanisms.yml:6:45: the aliases stand for more than 100000 values, \
        expected a file of ordinary size, write fewer of them, or the values out\n";
    assert_eq!(reported(&bomb(9)), expected);
    // 12340 values are read
    let reported = reported(&bomb(4));
    assert!(!reported.contains("alias") && reported.contains("the key `a4`"), "{reported}");
}

#[test]
fn aliases_are_nested_up_to_a_bound() {
    let deep = |inner: &str| format!("{}{inner}{}", "[".repeat(40), "]".repeat(40));
    let bomb = format!("a: &a {}\nb: &b {}\nc: {}\n", deep("x"), deep("*a"), deep("*b"));
    let reported = reported_of(URDF.as_bytes(), Some(bomb.as_bytes()), false);
    assert_eq!(reported.matches("nested too deep").count(), 1, "{reported}");
}

#[test]
fn a_file_too_large_is_refused() {
    let large = vec![b' '; (64 << 20) + 1];
    let expected = "robot.urdf:1:1: the file is larger than 64 MiB, expected a robot of ordinary \
        size, leave out what a robot does not need\n";
    assert_eq!(reported_of(&large, None, false), expected);
}

#[test]
fn names_of_a_megabyte_are_shortened_in_messages() {
    let long = "x".repeat(1 << 20);
    let urdf = URDF.replace("\"rod\"", &format!("\"{long}\""));
    let reported = reported(&urdf, YAML);
    assert_eq!(reported.lines().count(), 1);
    assert!(reported.starts_with(
        "submechanisms.yml:13:21: `successor_body` names the link `rod`, which does not exist"
    ));
    let fine = reported_of(
        urdf.as_bytes(),
        Some(YAML.replace(": rod", &format!(": {long}")).as_bytes()),
        false,
    );
    assert_eq!(fine, "");
    let reported = super::reported(URDF, &YAML.replace("elbow", &long));
    assert!(reported.len() < 2000, "{}", reported.len());
}

#[test]
fn control_characters_are_made_visible() {
    let reported = reported(URDF, &with(YAML, "[slide]", "[\"sli\\0\\e[31mde\"]"));
    let expected = "submechanisms.yml:9:23: `jointnames_active` names `sli\\u{0}\\u{1b}[31mde`, which is not in the spanning tree, \
        expected names of jointnames_spanningtree, add it to jointnames_spanningtree or remove it\n";
    assert_eq!(reported, expected);
    assert!(reported_of(b"<robot name=\"a\0b\"/>", None, false).starts_with("robot.urdf:1:"));
    assert!(
        reported_of(URDF.as_bytes(), Some(b"submechanisms: \0"), false)
            .starts_with("submechanisms.yml:1:")
    );
}

#[test]
fn thousands_of_faults_are_listed_up_to_a_thousand() {
    let urdf = format!("<robot name=\"r\">{}</robot>", "<link/>".repeat(50_000));
    let reported = reported_of(urdf.as_bytes(), None, false);
    let errors: Vec<&str> = reported.lines().filter(|line| !line.contains("no inertial")).collect();
    assert_eq!(errors.len(), 1001);
    assert!(errors[1000].contains("further errors are not listed"), "{}", errors[1000]);
}

#[test]
fn many_attributes_and_namespaces_are_refused() {
    let attributes: String = (0..300).map(|i| format!(" a{i}=\"\"")).collect();
    let reported = reported_of(format!("<robot{attributes}/>").as_bytes(), None, false);
    let expected = "robot.urdf:1:1: the element `robot` has too many attributes or namespaces, \
        expected at most 256, remove those that no reader knows\n";
    assert_eq!(reported, expected);
    let many = "<a xmlns:b=\"c\"/>".repeat(2000);
    assert!(
        reported_of(format!("<robot name=\"r\">{many}</robot>").as_bytes(), None, false)
            .contains("too many attributes or namespaces")
    );
}

#[test]
fn a_long_list_costs_no_more_than_its_length() {
    let axes: String =
        (0..20_000).map(|i| format!("    - {{name: a{i}, axis: [0, 0, 0, 0, 1, 0]}}\n")).collect();
    let reported =
        reported(URDF, &with(YAML, "    - {name: y, axis: [0, 0, 0, 0, 1, 0]}\n", &axes));
    let expected = "submechanisms.yml:1:1: the loops have 20001 constraint_axes, expected at most 1024, split the robot into robots of their own\n\
        submechanisms.yml:21:7: the loop constraint has 20001 constraint_axes, expected at most six, remove those that the others imply\n";
    assert_eq!(reported, expected);
}

#[test]
fn a_file_cut_anywhere_is_reported_or_read() {
    for end in (0..URDF.len()).step_by(3) {
        assert!(
            reported_of(&URDF.as_bytes()[..end], Some(YAML.as_bytes()), false)
                .contains("robot.urdf:")
                || end + 1 >= URDF.len()
        );
    }
    for end in 0..YAML.len() {
        reported_of(URDF.as_bytes(), Some(&YAML.as_bytes()[..end]), false);
    }
}

#[test]
fn damaged_files_are_reported_or_read() {
    const SEED: u64 = 0x5a44;
    println!("seed {SEED:#x}");
    let mut random = Random(SEED);
    let alphabet = b"<>/=\"'&;[]{}:,-#!*&|%@`?\n\r\t \0\xff\xc3\xa90123456789.eE+-axyz";
    let mut robots: Vec<(&str, &str)> = vec![(URDF, YAML)];
    robots.extend(["torso", "parallelogram"].into_iter().filter_map(sarrus_models::bundled_text));
    for round in 0..1500 {
        let (urdf, yaml) = robots[round % robots.len()];
        let mut files = [urdf.as_bytes().to_vec(), yaml.as_bytes().to_vec()];
        for _ in 0..1 + random.below(4) {
            let file = &mut files[random.below(2)];
            let at = random.below(file.len());
            match random.below(4) {
                0 => file[at] ^= 1 << random.below(8),
                1 => file[at] = alphabet[random.below(alphabet.len())],
                2 => file.insert(at, alphabet[random.below(alphabet.len())]),
                _ => {
                    let end = file.len().min(at + random.below(20));
                    file.drain(at..end);
                }
            }
            if file.is_empty() {
                file.push(b'x');
            }
        }
        reported_of(&files[0], Some(&files[1]), random.below(2) == 0);
    }
}

#[test]
fn what_a_parser_says_of_control_characters_and_of_the_end_stays_one_line_within_the_text() {
    for (urdf, position, sign) in
        [("<robot name=\"a\"\u{15}/>", "1:16", "\\u{15}"), ("<robot/\n>", "1:8", "\\n")]
    {
        let reported = reported_of(urdf.as_bytes(), None, false);
        assert!(
            reported.starts_with(&format!("robot.urdf:{position}: this is not XML")),
            "{reported}"
        );
        assert!(reported.contains(sign) && reported.trim_end().lines().count() == 1, "{reported}");
        assert!(!reported.trim_end().chars().any(char::is_control), "{reported:?}");
    }
    // the scanner reports the line behind the last
    let reported = reported_of(URDF.as_bytes(), Some(b"{"), false);
    assert!(reported.starts_with("submechanisms.yml:1:2: this is not YAML"), "{reported}");
}
