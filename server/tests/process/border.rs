//! Faults from outside of the server: clients that end half-way, stopped processes, removed
//! folders, truncated files.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use rustix::process::Signal;
use sarrus_client::{ConnectError, ConnectOptions, Error, Status, Transport};
use sarrus_proto::ServerName;
use sarrus_proto::control::Call;
use sarrus_proto::message::MAX_SERVICE_CLIENTS;
use sarrus_proto::socket::{ControlListener, ControlSocket};
use sarrus_torture::patience::poll;
use sarrus_torture::process::{descriptors, send_signal};
use sarrus_torture::raw::Raw;

use crate::support::{Asker, STATE, Sandbox, options, wait_until};

const NOTHING: Vec<PathBuf> = Vec::new();

#[test]
fn a_client_that_ends_at_any_stage_of_attaching_leaves_nothing() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("stages", &["--lanes", "2"]);
    let mut honest = Asker::new(sandbox.connect("stages", Transport::Lane).unwrap());
    assert_eq!(honest.ask().unwrap().status, Status::Ok);
    // until its first, smaller lane is given back
    wait_until("one lane is taken", || honest.robot.statistics().unwrap().lanes_taken == 1);
    let files = sandbox.leftovers();
    let open = descriptors(server.id());
    // forgotten, not dropped: a client that ends takes nothing down
    let stages: [fn(&Raw); 6] = [
        |_| (),
        |liar| drop(liar.call(Call::Lane { n_in: 39, n_out: 13 }).unwrap()),
        |liar| std::mem::forget(liar.take_lane([39, 13]).unwrap()),
        |liar| drop(liar.call(Call::Service).unwrap()),
        |liar| std::mem::forget(liar.take_service().unwrap()),
        |liar| {
            let (node, mut client) = liar.take_service().unwrap();
            assert!(client.send(&liar.head(0, 1), &[0.0; 39]));
            std::mem::forget((node, client));
        },
    ];
    for round in 0..90 {
        let liar = sandbox.raw("stages");
        stages[round % stages.len()](&liar);
        drop(liar);
        assert_eq!(honest.ask().unwrap().status, Status::Ok);
    }
    wait_until("the files are as before", || sandbox.leftovers().len() == files.len());
    wait_until("descriptors are as before", || descriptors(server.id()) == open);
    let statistics = honest.robot.statistics().unwrap();
    assert_eq!((statistics.lanes_taken, statistics.clients.len()), (1, 1), "{statistics:?}");
    drop(honest);
    assert!(server.stop().success());
    assert_eq!(sandbox.leftovers(), NOTHING);
}

#[test]
fn a_killed_clients_lane_is_free_for_the_next_client() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("quick", &["--lanes", "1", "--wait", "busy"]);
    let waits: Vec<Duration> = (0..20)
        .map(|_| {
            sandbox.client("quick", Transport::Lane).kill();
            let start = Instant::now();
            wait_until("the lane is free", || sandbox.connect("quick", Transport::Lane).is_ok());
            start.elapsed()
        })
        .collect();
    println!("from a kill to the next client's lane: {waits:?}");
}

#[test]
fn a_stopped_server_is_said_to_be_stopped_and_goes_on() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("stopped", &[]);
    let timeout = Duration::from_millis(300);
    for transport in [Transport::Lane, Transport::Service] {
        let options = ConnectOptions { transport, timeout, ..options() };
        let mut asker = sandbox.attach("stopped", options);
        wait_until("what it had before its plan is gone", || {
            let statistics = asker.robot.statistics().unwrap();
            statistics.lanes_taken == u64::from(transport == Transport::Lane)
        });
        let open = descriptors(server.id());
        send_signal(server.id(), Signal::STOP);
        for _ in 0..3 {
            let error = asker.ask().unwrap_err();
            assert!(
                matches!(
                    error,
                    Error::NoAnswer { .. } | Error::Connect(ConnectError::NoAnswer { .. })
                ),
                "{error}"
            );
            let words = error.to_string();
            let said = format!("its process {} is stopped by a signal", server.id());
            assert!(words.contains(&said), "{words}");
            assert!(asker.output.iter().all(|number| number.is_nan()));
        }
        send_signal(server.id(), Signal::CONT);
        // requests that were given up meanwhile leave no descriptor behind
        wait_until("it answers", || asker.ask().is_ok_and(|answer| answer.status == Status::Ok));
        wait_until("descriptors are as before", || descriptors(server.id()) == open);
    }
    assert!(server.stop().success());
}

#[test]
fn the_first_call_of_a_stopped_server_says_how_long_was_waited() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("still", &[]);
    let options = ConnectOptions { timeout: Duration::from_millis(300), ..options() };
    let mut robot = poll(|| sandbox.connect_with("still", options).ok()).unwrap();
    send_signal(server.id(), Signal::STOP);
    let words = robot.prepare(&STATE).unwrap_err().to_string();
    assert!(words.contains("gave no answer within 0.3 s"), "{words}");
    send_signal(server.id(), Signal::CONT);
    assert!(server.stop().success());
}

#[test]
fn a_timeout_can_be_for_ever() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("ever", &[]);
    for transport in [Transport::Lane, Transport::Service] {
        let options = ConnectOptions { transport, timeout: Duration::MAX, ..options() };
        let mut asker = Asker::new(sandbox.connect_with("ever", options).unwrap());
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
    }
}

#[test]
fn one_client_too_many_of_the_service_is_told_so() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("crowd", &["--lanes", "1"]);
    let mut askers: Vec<Asker> = (0..MAX_SERVICE_CLIENTS)
        .map(|_| Asker::new(sandbox.connect("crowd", Transport::Service).unwrap()))
        .collect();
    let error = sandbox.connect("crowd", Transport::Service).err().unwrap();
    assert!(matches!(error, ConnectError::NoFreeSlot { limit: 32, .. }), "{error}");
    askers.iter_mut().for_each(|asker| assert_eq!(asker.ask().unwrap().status, Status::Ok));
    let mut lane = Asker::new(sandbox.connect("crowd", Transport::Lane).unwrap());
    assert_eq!(lane.ask().unwrap().status, Status::Ok);
    // a client that leaves makes room
    askers.pop();
    let mut next = Asker::new(sandbox.connect("crowd", Transport::Service).unwrap());
    assert_eq!(next.ask().unwrap().status, Status::Ok);
}

#[test]
fn one_process_cannot_take_all_lanes_and_connections() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("shared", &["--lanes", "8"]);
    let mut own: Vec<Asker> =
        (0..7).map(|_| Asker::new(sandbox.connect("shared", Transport::Lane).unwrap())).collect();
    let us = std::process::id();
    let error = sandbox.connect("shared", Transport::Lane).err().unwrap();
    assert!(matches!(error, ConnectError::NoFreeSlot { limit: 7, .. }), "{error}");
    assert!(error.to_string().contains(&format!("; process {us} holds 7; ")), "{error}");
    sandbox.client("shared", Transport::Lane).kill();
    // and its connections with nothing but a greeting
    let room = 8 + MAX_SERVICE_CLIENTS + 64 - own.len();
    let _crowd: Vec<Raw> = (0..room).map(|_| sandbox.raw("shared")).collect();
    let error = sandbox.connect("shared", Transport::Service).err().unwrap();
    assert!(error.to_string().contains(&format!("; process {us} holds 104; ")), "{error}");
    for transport in [Transport::Lane, Transport::Service] {
        sandbox.client("shared", transport).kill();
    }
    own.iter_mut().for_each(|asker| assert_eq!(asker.ask().unwrap().status, Status::Ok));
}

#[test]
fn a_client_behind_a_crowd_that_says_nothing_is_told_that_there_is_no_room() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("queue", &["--lanes", "1"]);
    let mut honest = Asker::new(sandbox.connect("queue", Transport::Lane).unwrap());
    assert_eq!(honest.ask().unwrap().status, Status::Ok);
    let open = descriptors(server.id());
    let folder =
        sandbox.domain().server_folders(&ServerName::new("queue").unwrap()).next().unwrap();
    // three times as many as are served; without a greeting they are neither served nor refused
    let crowd: Vec<ControlSocket> =
        (0..3 * 97).map(|_| ControlSocket::connect(&folder).unwrap()).collect();
    for _ in 0..3 {
        let error = sandbox.connect("queue", Transport::Lane).err().unwrap();
        assert!(matches!(error, ConnectError::NoFreeSlot { limit: 97, .. }), "{error}");
        assert!(error.to_string().starts_with("all 97 connections of the server are taken;"));
    }
    // earlier clients stay
    assert_eq!(honest.ask().unwrap().status, Status::Ok);
    assert!(!crowd[0].is_closed());
    drop(crowd);
    wait_until("all is as before", || descriptors(server.id()) <= open);
    assert!(sandbox.connect("queue", Transport::Service).is_ok());
}

#[test]
fn a_client_whose_connection_ends_before_it_is_heard_comes_again() {
    let sandbox = Sandbox::new();
    let folder = sandbox.make_root().join("server/door");
    fs::create_dir_all(&folder).unwrap();
    // a listener that ends every connection, then none, then a server
    let listener = ControlListener::new(&folder).unwrap();
    let (sender, refused) = std::sync::mpsc::channel();
    let stop = std::thread::spawn(move || {
        let mut n = 0;
        while n < 5 {
            n += usize::from(listener.accept().unwrap().is_some());
        }
        listener.unlink();
        sender.send(n).unwrap();
    });
    let error = sandbox.connect("door", Transport::Lane).err().unwrap();
    assert!(matches!(error, ConnectError::NoServer(..)), "{error}");
    assert_eq!(refused.recv().unwrap(), 5);
    stop.join().unwrap();
    let _server = sandbox.serve("door", &[]);
    assert!(sandbox.connect("door", Transport::Lane).is_ok());
}

#[test]
fn a_server_whose_folders_are_cleared_away_is_found_again() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("cleared", &[]);
    let mut asker = Asker::new(sandbox.connect("cleared", Transport::Lane).unwrap());
    fs::remove_dir_all(sandbox.domain().root()).unwrap();
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    wait_until("new clients attach", || sandbox.connect("cleared", Transport::Lane).is_ok());
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    drop(asker);
    // the name is still this server's
    let second = sandbox.command(crate::support::ROBOT, "cleared", &[]).output().unwrap();
    assert_eq!(second.status.code(), Some(2));
    assert!(server.stop().success());
    assert_eq!(sandbox.leftovers(), NOTHING);
}

#[test]
fn a_client_that_cuts_its_files_short_disturbs_nobody() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("short", &[]);
    let mut honest = Asker::new(sandbox.connect("short", Transport::Service).unwrap());
    let before = sandbox.leftovers();
    let liar = sandbox.raw("short");
    let (_node, mut client) = liar.take_service().unwrap();
    // the segment that its requests lie in
    assert!(client.send(&liar.head(0, 1), &[0.0; 39]));
    let is_data = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "data");
    let own: Vec<PathBuf> =
        sandbox.leftovers().into_iter().filter(|path| !before.contains(path)).collect();
    let own: Vec<&PathBuf> = own.iter().filter(|path| is_data(path)).collect();
    assert!(!own.is_empty());
    // a child does it: this process has the files mapped itself
    for path in own {
        let status = Command::new("truncate").args(["-s", "0"]).arg(path).status().unwrap();
        assert!(status.success());
    }
    for _ in 0..100 {
        assert_eq!(honest.ask().unwrap().status, Status::Ok);
    }
    // dropping them would kill this process
    std::mem::forget((client, _node));
    drop(liar);
    assert_eq!(honest.ask().unwrap().status, Status::Ok);
    drop(honest);
    assert!(server.stop().success());
    assert_eq!(sandbox.leftovers(), NOTHING);
}

#[test]
fn a_client_that_empties_its_files_before_they_are_mapped_is_refused() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("hollow", &[]);
    let mut honest = Asker::new(sandbox.connect("hollow", Transport::Lane).unwrap());
    let threads = || fs::read_dir(format!("/proc/{}/task", server.id())).unwrap().count();
    let usual = threads();
    for ending in ["data", "connection"] {
        let before = sandbox.leftovers();
        let liar = sandbox.raw("hollow");
        let opened = liar.open_service().unwrap();
        let is_its = |path: &PathBuf| {
            path.extension().is_some_and(|found| found == ending) && !before.contains(path)
        };
        let own: Vec<PathBuf> = sandbox.leftovers().into_iter().filter(is_its).collect();
        assert!(!own.is_empty(), "{ending}");
        for path in own {
            let status = Command::new("truncate").args(["-s", "0"]).arg(path).status().unwrap();
            assert!(status.success());
        }
        assert!(liar.try_call(Call::Serve).unwrap().is_err(), "{ending}");
        assert_eq!(honest.ask().unwrap().status, Status::Ok);
        assert!(sandbox.connect("hollow", Transport::Service).is_ok());
        // dropping them would kill this process
        std::mem::forget(opened);
        drop(liar);
        wait_until("its thread ends", || threads() == usual);
    }
    drop(honest);
    assert!(server.stop().success());
    assert_eq!(sandbox.leftovers(), NOTHING);
}

#[test]
fn tidy_clears_what_is_dead_and_nothing_that_lives() {
    let sandbox = Sandbox::new();
    let dead = sandbox.serve("dead", &[]);
    let client = sandbox.client("dead", Transport::Service);
    let server = sandbox.serve("alive", &[]);
    let mut asker = Asker::new(sandbox.connect("alive", Transport::Lane).unwrap());
    let (code, cleared, words) = sandbox.sarrus(&["tidy"]);
    assert_eq!((code, cleared.as_str(), words.as_str()), (Some(0), "", ""));

    dead.kill();
    client.kill();
    let (code, cleared, _) = sandbox.sarrus(&["tidy", "--format", "json"]);
    let cleared: serde_json::Value = serde_json::from_str(&cleared).unwrap();
    assert!(code == Some(0) && cleared["cleared"].as_array().unwrap().len() > 2, "{cleared}");
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    let name = ServerName::new("dead").unwrap();
    assert!(!sandbox.domain().server_folders(&name).next().unwrap().exists());
    assert_eq!(sandbox.sarrus(&["tidy"]).1, "");

    drop(asker);
    server.kill();
    assert_eq!(sandbox.sarrus(&["tidy"]).0, Some(0));
    assert_eq!(sandbox.leftovers(), NOTHING);
}

#[test]
fn top_shows_a_server_and_its_clients() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("seen", &[]);
    let mut askers = [Transport::Lane, Transport::Service]
        .map(|transport| Asker::new(sandbox.connect("seen", transport).unwrap()));
    askers.iter_mut().for_each(|asker| assert_eq!(asker.ask().unwrap().status, Status::Ok));
    let (code, text, words) = sandbox.sarrus(&["top", "seen", "--format", "json"]);
    assert_eq!((code, words.as_str()), (Some(0), ""));
    let seen: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(seen["process"], server.id());
    assert_eq!((&seen["statuses"]["ok"], &seen["requests"]["lane"]), (&2.into(), &1.into()));
    assert_eq!(seen["heartbeat"]["state"], "alive");
    let ends: Vec<&str> = seen["clients"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["end"].as_str().unwrap())
        .collect();
    assert_eq!(ends, ["lane", "service", "none"]);
    assert!(seen["latency_ns"]["p50"].as_u64().unwrap() > 0 && seen["rates"]["lane"] == 0.0);
    assert!(sandbox.sarrus(&["top", "seen"]).1.starts_with("seen: process "));
    assert_eq!(sandbox.sarrus(&["top", "nobody"]).0, Some(2));
}

#[test]
fn an_entry_that_is_seen_again_is_answered_once() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("again", &["--wait", "busy"]);
    let liar = sandbox.raw("again");
    let (plan, _) = liar.plan(&STATE).unwrap();
    let (_node, mut lane) = liar.take_lane([39, 256]).unwrap();
    for sequence in 1..50 {
        let head = liar.head(plan, sequence);
        lane.outbox.numbers().iter().for_each(|word| word.store(0, Relaxed));
        lane.outbox.publish(head);
        wait_until("an answer", || lane.inbox.poll().is_some());
        // the same request once more
        lane.outbox.publish(head);
        std::thread::sleep(Duration::from_millis(2));
        assert!(lane.inbox.poll().is_none(), "{sequence}");
    }
}

#[test]
fn a_client_that_breaks_its_service_ends_with_its_plans() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("broken", &[]);
    let mut honest = Asker::new(sandbox.connect("broken", Transport::Service).unwrap());
    let before = sandbox.leftovers();
    let liar = sandbox.raw("broken");
    let (node, client) = liar.take_service().unwrap();
    liar.plan(&crate::plans::distinct(7)).unwrap();
    assert_eq!(honest.robot.statistics().unwrap().plans, 2);
    // the shared record of the connection, over which the transport panics
    let is_its = |path: &PathBuf| {
        path.extension().is_some_and(|ending| ending == "connection") && !before.contains(path)
    };
    let own: Vec<PathBuf> = sandbox.leftovers().into_iter().filter(is_its).collect();
    assert!(!own.is_empty());
    for path in own {
        let status = Command::new("truncate").args(["-s", "0"]).arg(path).status().unwrap();
        assert!(status.success());
    }
    wait_until("it is ended", || liar.socket.is_closed());
    wait_until("its plan is free", || honest.robot.statistics().unwrap().plans == 1);
    assert_eq!(honest.robot.statistics().unwrap().clients.len(), 1);
    assert_eq!(honest.ask().unwrap().status, Status::Ok);
    // dropping them would kill this process
    std::mem::forget((client, node));
    drop((liar, honest));
    assert!(server.stop().success());
    assert_eq!(sandbox.leftovers(), NOTHING);
}
