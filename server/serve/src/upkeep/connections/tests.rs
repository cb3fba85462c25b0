//! Clients that come and go while the answering thread gets no processor.

use std::fs;

use rtrb::RingBuffer;
use sarrus_proto::board::class_of;
use sarrus_proto::{Domain, ServerName};

use super::*;
use crate::answering::thread::{MAX_ORDERS, MAX_RETIRED};
use crate::system::sigbus::REPLACING;

#[test]
fn a_lane_is_granted_while_that_of_a_dead_client_is_on_its_way_back() {
    let _replacing = REPLACING.lock();
    let root = std::env::temp_dir().join(format!("sarrus-places-{}", std::process::id()));
    let domain = Domain::at(&root).unwrap();
    let run = Run::start(&domain, &ServerName::new("places").unwrap()).unwrap();
    let places = Connections::places(1);
    let (orders_in, mut orders) = RingBuffer::new(MAX_ORDERS * places);
    let (mut retired, retired_out) = RingBuffer::new(MAX_RETIRED * places);
    let mut connections = Connections::new(run.listen().unwrap(), 1, orders_in, retired_out);
    let _clients = [0; 3].map(|_| ControlSocket::connect(run.name_folder()).unwrap());
    connections.wait(Duration::ZERO);
    let classes = [class_of(1).unwrap(); 2];

    connections.make_lane(&run, 1, classes).unwrap();
    let no_lane = Err(Refusal::NoLane { limit: 1 });
    assert_eq!(connections.make_lane(&run, 2, classes), no_lane);
    connections.close(1);
    connections.make_lane(&run, 2, classes).unwrap();
    // and makes no room for a second one
    assert_eq!(connections.make_lane(&run, 3, classes), no_lane);

    // the answering thread at last
    connections.close(2);
    let mut served = Vec::new();
    while let Ok(order) = orders.pop() {
        match order {
            Order::Serve { place, end } => served.push((place, end)),
            Order::Retire { place } => {
                let index = served.iter().position(|(one, _)| *one == place).unwrap();
                assert!(retired.push(served.swap_remove(index)).is_ok());
            }
        }
    }
    connections.collect();
    assert!(served.is_empty() && connections.places.iter().all(Option::is_none));
    drop((connections, run));
    domain.tidy();
    assert!(!fs::exists(root).unwrap());
}

#[test]
fn there_is_room_for_every_order_of_a_place() {
    let _replacing = REPLACING.lock();
    let root = std::env::temp_dir().join(format!("sarrus-orders-{}", std::process::id()));
    let domain = Domain::at(&root).unwrap();
    let run = Run::start(&domain, &ServerName::new("orders").unwrap()).unwrap();
    // the capacity of one place
    let (orders_in, mut orders) = RingBuffer::new(MAX_ORDERS);
    let (mut retired, retired_out) = RingBuffer::new(MAX_RETIRED);
    let mut connections = Connections::new(run.listen().unwrap(), 1, orders_in, retired_out);
    let _clients = [0; 2].map(|_| ControlSocket::connect(run.name_folder()).unwrap());
    connections.wait(Duration::ZERO);
    let classes = [class_of(1).unwrap(); 2];

    // the answering thread finds a lane broken, and gets no processor from there on
    connections.make_lane(&run, 1, classes).unwrap();
    let Ok(Order::Serve { place, end }) = orders.pop() else { panic!("no lane") };
    connections.make_batches(1).unwrap();
    drop(end);
    assert!(retired.push((place, End::Broken)).is_ok());
    connections.close(1);
    connections.make_lane(&run, 2, classes).unwrap();
    connections.make_batches(2).unwrap();
    connections.close(2);

    let of_place = |order: &Order| match order {
        Order::Serve { place, .. } | Order::Retire { place } => *place,
    };
    let under_way: Vec<Order> = std::iter::from_fn(|| orders.pop().ok()).collect();
    assert!(under_way.iter().all(|order| of_place(order) == place));
    assert_eq!(under_way.len(), MAX_ORDERS);
    assert!(matches!(under_way.last(), Some(Order::Retire { .. })));
    for order in under_way {
        if let Order::Serve { place, end } = order {
            assert!(retired.push((place, end)).is_ok());
        }
    }
    connections.collect();
    assert!(connections.places.iter().all(Option::is_none));
    drop((connections, run));
    domain.tidy();
    assert!(!fs::exists(root).unwrap());
}
