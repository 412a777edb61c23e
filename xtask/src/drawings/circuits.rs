//! The circuits of docs/bring-up.md, each as a table of its parts. Coordinates are grid units of 10 pixels.

use super::drawing::Drawing;
use super::part::{Enable, Kind, Part, Side, connector, dot, gate, label, mosfet, two, wire};
use super::sheet::Anchor;

/// All drawings.
pub(super) fn all() -> [Drawing; 4] {
    [servo_bus(), servo_bus_buffered(), power(), vacuum()]
}

fn servo_bus() -> Drawing {
    let parts = vec![
        connector(15, 10, Side::Right, "Board", &[(12, "3.3 V"), (22, "PA2"), (34, "GND")]),
        wire(&[(15, 12), (24, 12)]),
        two(Kind::Resistor, (24, 12), (24, 22), "R1\n680 Ω"),
        dot(24, 22),
        wire(&[(15, 22), (34, 22)]),
        two(Kind::Resistor, (34, 22), (42, 22), "R2  100 Ω"),
        wire(&[(42, 22), (74, 22)]),
        dot(48, 22),
        two(Kind::Clamp, (48, 34), (48, 22), "D1\n5 V ESD clamp,\n20 pF or less"),
        dot(48, 34),
        wire(&[(15, 34), (74, 34)]),
        wire(&[(68, 28), (74, 28)]),
        label((67, 28), Anchor::End, "V+"),
        connector(74, 16, Side::Left, "Servos: 5264, 3 pins", &[(22, "signal"), (28, "V+"), (34, "GND")]),
        label(
            (2, 39),
            Anchor::Start,
            "V+ comes from the power circuit, never from the board. No internal pull-up at PA2.",
        ),
    ];
    Drawing { name: "servo-bus", title: "Servo bus, one wire", size: (93, 42), parts }
}

fn servo_bus_buffered() -> Drawing {
    let board = [(12, "3.3 V"), (22, "PA2"), (42, "PA1"), (52, "GND")];
    let parts = vec![
        connector(15, 10, Side::Right, "Board", &board),
        wire(&[(15, 12), (20, 12)]),
        two(Kind::Resistor, (20, 12), (20, 22), "R1\n1 kΩ"),
        dot(20, 22),
        dot(32, 22),
        wire(&[(15, 22), (38, 22)]),
        gate((38, 22), (48, 22), Enable::High, "U1  74HCT1G126\nat 5 V"),
        wire(&[(48, 22), (58, 22)]),
        dot(54, 22),
        wire(&[(54, 22), (54, 34), (48, 34)]),
        gate((48, 34), (38, 34), Enable::Low, "U2  74LVC1G125\nat 3.3 V"),
        wire(&[(38, 34), (32, 34), (32, 22)]),
        wire(&[(43, 18), (43, 16), (28, 16), (28, 42)]),
        dot(28, 42),
        dot(22, 42),
        wire(&[(15, 42), (43, 42), (43, 38)]),
        two(Kind::Resistor, (22, 42), (22, 52), "R2\n10 kΩ"),
        dot(22, 52),
        two(Kind::Resistor, (58, 22), (66, 22), "R3  100 Ω"),
        wire(&[(66, 22), (98, 22)]),
        dot(70, 22),
        label((70, 10), Anchor::Middle, "5 V"),
        two(Kind::Resistor, (70, 12), (70, 22), "R4\n10 kΩ"),
        dot(78, 22),
        two(Kind::Clamp, (78, 52), (78, 22), "D1\n5 V ESD\nclamp"),
        dot(78, 52),
        wire(&[(15, 52), (98, 52)]),
        wire(&[(94, 37), (98, 37)]),
        label((93, 37), Anchor::End, "V+"),
        connector(98, 14, Side::Left, "Servos: 5264", &[(22, "signal"), (37, "V+"), (52, "GND")]),
        label(
            (2, 57),
            Anchor::Start,
            "PA1 is the direction. High: the board drives the bus. R2 keeps a board in reset listening.",
        ),
    ];
    Drawing { name: "servo-bus-buffered", title: "Servo bus with a buffer at 5 V", size: (115, 60), parts }
}

fn power() -> Drawing {
    let parts = vec![
        connector(15, 10, Side::Right, "Supply 6 to 8.4 V", &[(12, "+"), (42, "GND")]),
        wire(&[(15, 12), (20, 12)]),
        two(Kind::Fuse, (20, 12), (28, 12), "F1  10 A slow"),
        wire(&[(28, 12), (46, 12)]),
        dot(33, 12),
        two(Kind::Switch, (46, 12), (54, 12), "S1  emergency stop"),
        wire(&[(54, 12), (58, 12)]),
        // Inrush limiter and regulator: frames with terminals on both sides.
        connector(58, 13, Side::Left, "Inrush limiter", &[(12, "in")]),
        connector(73, 13, Side::Right, "", &[(12, "out")]),
        wire(&[(73, 12), (96, 12)]),
        wire(&[(33, 12), (33, 24), (36, 24)]),
        connector(36, 13, Side::Left, "Regulator", &[(24, "in"), (30, "GND")]),
        connector(51, 13, Side::Right, "", &[(24, "5 V"), (30, "GND")]),
        wire(&[(51, 24), (60, 24)]),
        wire(&[(51, 30), (60, 30)]),
        connector(60, 10, Side::Left, "Board", &[(24, "5 V"), (30, "GND")]),
        dot(78, 12),
        two(Kind::Electrolytic, (78, 12), (78, 32), "C1\n2200 µF 16 V\nlow ESR"),
        wire(&[(78, 32), (78, 46)]),
        dot(78, 46),
        connector(96, 12, Side::Left, "7 servos", &[(12, "V+"), (46, "GND")]),
        // The star: a separate ground wire for each consumer.
        dot(20, 42),
        wire(&[(15, 42), (33, 42), (33, 30), (36, 30)]),
        wire(&[(20, 42), (20, 46), (96, 46)]),
        label((20, 39), Anchor::Start, "star point"),
        label(
            (2, 51),
            Anchor::Start,
            "The board is supplied before S1: the servos are never on while the board is off.",
        ),
        label((2, 54), Anchor::Start, "S1 breaks 10 A of direct current, and stays open when it is hit."),
        label(
            (2, 57),
            Anchor::Start,
            "The limiter charges C1 with 1 A. Without it, closing S1 welds its contacts: about 100 A.",
        ),
    ];
    Drawing {
        name: "power",
        title: "Power, and the switch that is the emergency stop",
        size: (111, 60),
        parts,
    }
}

fn vacuum() -> Drawing {
    let mut parts = driver(14, 1, "PC6", "Pump");
    parts.extend(driver(46, 2, "PC7", "Valve"));
    parts.push(label(
        (2, 70),
        Anchor::Start,
        "V is the voltage that pump and valve are rated for. Its GND goes to the star point.",
    ));
    Drawing { name: "vacuum", title: "Pump and valve", size: (93, 73), parts }
}

/// An output with its load, `y` grid units from the top.
fn driver(y: i32, number: i32, pin: &str, load: &str) -> Vec<Part> {
    vec![
        connector(15, 10, Side::Right, "Board", &[(y, pin), (y + 18, "GND")]),
        wire(&[(15, y), (22, y)]),
        two(Kind::Resistor, (22, y), (30, y), &format!("R{number}1  100 Ω")),
        wire(&[(30, y), (42, y)]),
        dot(36, y),
        two(Kind::Resistor, (36, y), (36, y + 18), &format!("R{number}2\n10 kΩ")),
        dot(36, y + 18),
        mosfet((42, y), &format!("Q{number}\nRDS(on) given\nat VGS 2.5 V")),
        wire(&[(45, y + 3), (45, y + 18)]),
        wire(&[(15, y + 18), (45, y + 18)]),
        wire(&[(45, y - 3), (45, y - 4), (74, y - 4)]),
        dot(62, y - 4),
        two(Kind::Diode, (62, y - 4), (62, y + 8), &format!("D{number}\nSchottky 3 A")),
        wire(&[(62, y + 8), (74, y + 8)]),
        connector(74, 13, Side::Left, load, &[(y - 4, "-"), (y + 8, "+")]),
        dot(68, y + 8),
        wire(&[(68, y + 8), (68, y + 13)]),
        label((68, y + 15), Anchor::Middle, "V"),
    ]
}
