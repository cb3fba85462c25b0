//! Recorded answers of a kernel, and answers that are none.

use super::*;

// Answers of Linux 6.1, recorded; statistics and settings of the network are left out of them.
/// `vcan`, up, with CAN FD.
const VCAN: &str = "\
    540000001000000001000000b90200000000180102000000c1000100000000000a0003007663616e30000000\
    08000d00e8030000050010000000000008000400\
    4800000010001200090001007663616e00000000";
/// An interface that is down.
const DOWN: &str = "\
    540000001000000001000000bb020000000018010200000080000000000000000a0003007663616e30000000\
    08000d00e8030000050010000200000008000400\
    4800000010001200090001007663616e00000000";
/// `slcan`, up, with `type can bitrate 500000`.
const SLCAN: &str = "\
    f40000001000000001000000d20200000000180103000000c1000100000000000b000300736c63616e300000\
    08000d000a000000050010000600000008000400\
    10000000b00012000800010063616e001c000300000000000000000001000000010000000000000000000000\
    880002002400010020a107000000000000000000\
    0000000000000000000000000000000000000000080003000000000008000400000000000c00050000000000\
    00000000080006000000000028000d0010270000\
    204e000050c30000a086010048e8010090d0030020a1070000350c0040420f0008000f00000000000c001180\
    0800010002000000";
/// `slcan` without a bit rate that the kernel knows, bus-off.
const OFF: &str = "\
    d00000001000000001000000cd020000000018010300000081000000000000000b000300736c63616e300000\
    08000d000a000000050010000200000008000400\
    100000008c0012000800010063616e001c000300000000000000000001000000010000000000000000000000\
    6400020008000300000000000800040003000000\
    0c0005000000000000000000080006000000000028000d0010270000204e000050c30000a086010048e80100\
    90d0030020a1070000350c0040420f0008000f00\
    000000000c0011800800010002000000";
/// No interface of this name.
const NONE: &str = "\
    400000000200000001000000bc020000edffffff2c0000001200010001000000000000000000000000000000\
    0000000000000000090003006e6f6e6500000000";

fn bytes(text: &str) -> Vec<u8> {
    text.as_bytes()
        .chunks(2)
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
        .collect()
}

fn read(text: &str) -> Interface {
    Interface::read(&bytes(text)).unwrap()
}

#[test]
fn answers_of_a_kernel_are_read() {
    let vcan = Interface {
        is_up: true,
        mtu: 72,
        queue: 1000,
        bitrate: None,
        data_bitrate: None,
        controller: None,
    };
    assert_eq!(read(VCAN), vcan);
    assert_eq!(read(DOWN), Interface { is_up: false, ..vcan });
    let slcan = Interface {
        mtu: 16,
        queue: 10,
        bitrate: Some(500_000),
        controller: Some(BusState::Active),
        ..vcan
    };
    assert_eq!(read(SLCAN), slcan);
    assert_eq!(read(OFF), Interface { bitrate: None, controller: Some(BusState::Off), ..slcan });
    assert_eq!(Interface::read(&bytes(NONE)), Err(InterfaceError::Refused(19)));
}

/// An answer with these rates and this state.
fn answer(up: u32, mtu: u32, timings: [(u16, u32); 2], state: u32) -> Interface {
    let attribute = |kind: u16, content: &[u8]| {
        let mut bytes =
            [4 + content.len() as u16, kind].map(u16::to_ne_bytes).as_flattened().to_vec();
        bytes.extend(content);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    };
    let timing = |(kind, rate): (u16, u32)| {
        attribute(kind, [rate.to_ne_bytes().as_slice(), &[0; 28]].concat().as_slice())
    };
    let data = [timings.map(timing).concat(), attribute(STATE, &state.to_ne_bytes())].concat();
    let info = [attribute(1, b"can\0"), attribute(DATA | 0x8000, &data)].concat();
    let list = [
        attribute(NAME, b"can0\0"),
        attribute(MTU, &mtu.to_ne_bytes()),
        attribute(LINK_INFO, &info),
    ]
    .concat();
    let length = (HEAD + INFO + list.len()) as u32;
    let mut bytes = length.to_ne_bytes().to_vec();
    bytes.extend([NEW_LINK, 0, 0, 0, 0, 0].map(u16::to_ne_bytes).as_flattened());
    bytes.extend([0, 3, up, 0].map(u32::to_ne_bytes).as_flattened());
    bytes.extend(list);
    Interface::read(&bytes).unwrap()
}

#[test]
fn an_interface_that_is_not_as_configured_is_refused_with_the_command_that_sets_it() {
    let rates = [(TIMING, 1_000_000), (DATA_TIMING, 5_000_000)];
    let fd = answer(UP, 72, rates, 0);
    assert_eq!(
        (fd.bitrate, fd.data_bitrate, fd.controller),
        (Some(1_000_000), Some(5_000_000), Some(BusState::Active))
    );
    assert!(fd.check("can0", Some(1_000_000), Some(5_000_000)) == Ok(None));
    assert!(fd.check("can0", None, None).is_ok());
    assert!(
        answer(UP, 72, [(TIMING, 996_016), (DATA_TIMING, 0)], 1).check(
            "can0",
            Some(1_000_000),
            None
        ) == Ok(Some(BusEvent::ErrorWarning)),
        "as near as a clock comes"
    );
    let message = |interface: Interface, (bitrate, data): (u32, Option<u32>)| {
        interface.check("can0", Some(bitrate), data).unwrap_err().to_string()
    };
    assert_eq!(
        message(fd, (500_000, None)),
        "can0 has a bit rate of 1000000 bit/s, expected 500000: `ip link set can0 down`, then \
            `ip link set can0 up type can bitrate 500000`"
    );
    let set = "`ip link set can0 up type can bitrate 1000000 dbitrate 2000000 fd on`";
    assert!(message(fd, (1_000_000, Some(2_000_000))).ends_with(set));
    assert_eq!(
        message(answer(0, 72, rates, 4), (1_000_000, Some(2_000_000))),
        format!("can0 is down: {set}")
    );
    assert!(
        message(answer(UP, 16, rates, 0), (1_000_000, Some(5_000_000)))
            .contains("carries no CAN FD")
    );
    assert!(message(answer(UP, 72, rates, 3), (1_000_000, None)).starts_with("can0 is bus-off"));
    assert_eq!(message(read(DOWN), (1_000_000, None)), "can0 is down: `ip link set can0 up`");
    assert!(
        read(VCAN).check("vcan0", Some(1_000_000), Some(5_000_000)).is_ok(),
        "no bit rate to compare"
    );
}

#[test]
fn a_long_queue_is_spoken_of_with_the_command_that_shortens_it() {
    assert_eq!(
        read(VCAN).advice("vcan0").unwrap(),
        "vcan0 has a txqueuelen of 1000, expected about 10: a long queue only makes torques old; \
            `ip link set vcan0 txqueuelen 10`"
    );
    assert_eq!(read(SLCAN).advice("slcan0"), None);
}

#[test]
fn what_is_no_answer_is_refused() {
    let whole = bytes(SLCAN);
    for end in 0..whole.len() {
        assert!(Interface::read(&whole[..end]).is_err(), "{end}");
    }
    // attributes that lie about their length end nowhere
    for place in HEAD + INFO..whole.len() {
        for wrong in [0, 1, 3, 0xFF] {
            let mut bytes = whole.clone();
            bytes[place] = wrong;
            let _ = Interface::read(&bytes);
        }
    }
}
