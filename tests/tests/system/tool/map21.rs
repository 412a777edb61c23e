//! `sevenbot` and the registers that only map 2.1 has, on an arm that serves both maps: `docs/protocol.md`, section 8.
//! The tool writes these registers with function 04. Such a write must not change the offsets of map 2.2, nor its reports, unless
//! it asks for reports of map 2.1 (M4).

use std::fs::{self, File};

use super::output::{failed, stored, succeeded, words};
use system_tests::registers::{EEPROM_LOCK, LAST_REFUSAL, OFFSET, STANDARD_POSE, TARGET_POSITION};
use system_tests::{TestArm, TestSetup, with_arm};

const OPTIONS: u8 = 20;

/// Keeps the port open, so that the simulator keeps the reports and the map of the last write when a program ends (M12).
fn hold_open(arm: &mut TestArm) -> File {
    let path = arm.lend_port();
    let held = File::options().read(true).write(true).open(path).expect("the port");
    arm.reopen(115_200);
    held
}

#[test]
fn options_are_a_setting_like_any_other() {
    with_arm(TestSetup::any(), |arm| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("arm.toml");
        let file = path.to_str().expect("UTF-8");
        let locked = failed(&arm.sevenbot(&["set", "options", "2"]), 1);
        assert!(locked.contains("options is 0, not 2: it is protected by the EEPROM lock"), "{locked}");
        stored(arm, &["set", "--unlock", "offset.2", "-5"]);
        let shown = stored(arm, &["set", "--unlock", "options", "2"]);
        assert_eq!(words(&shown, "20"), ["20", "options", "2", "alarm", "frames"]);
        assert_eq!((arm.register(OPTIONS), arm.register(EEPROM_LOCK)), (2, 1));
        succeeded(arm.sevenbot(&["backup", file]));
        let text = fs::read_to_string(&path).expect("a file");
        assert!(text.contains("offset = [0, -5, 0, 0, 0, 0, 0]\noptions = 2\n"), "{text}");

        stored(arm, &["set", "--unlock", "11..20", "0"]);
        assert_eq!((arm.read(OFFSET, 7), arm.register(OPTIONS)), (vec![0; 7], 0));
        let changes = stored(arm, &["restore", "--yes", file]);
        assert_eq!(words(&changes, "options"), ["options", "none", "->", "alarm", "frames"]);
        assert_eq!(arm.read(OFFSET, 8), [0, 0x85, 0, 0, 0, 0, 0, 2]);
        // A file without options, as from a program that does not know them.
        fs::write(&path, text.replace("options = 2\n", "").replace("-5", "3")).expect("a file");
        stored(arm, &["restore", "--yes", file]);
        assert_eq!(arm.read(OFFSET, 8), [0, 3, 0, 0, 0, 0, 0, 2], "a missing setting keeps its value");
        stored(arm, &["set", "--unlock", "11..20", "0"]);
    });
}

#[test]
fn a_write_of_map_21_leaves_reports_and_offsets_as_they_were() {
    with_arm(TestSetup::any(), |arm| {
        let held = hold_open(arm);
        arm.write_setting(OFFSET, &[0, 0x85]);
        succeeded(arm.sevenbot(&["set", "button-enable", "0"]));
        assert_eq!(arm.read(OFFSET, 2), [0, 0x85], "in the encoding of map 2.2");
        succeeded(arm.sevenbot(&["set", "feedback-frequency", "20"]));
        succeeded(arm.sevenbot(&["set", "button-enable", "1"]));
        stored(arm, &["set", "--unlock", "options", "1"]);
        let shown = succeeded(arm.sevenbot(&["get", "53", "66", "20"]));
        assert_eq!(words(&shown, "53")[2], "20", "the reports go on");
        assert_eq!((words(&shown, "66")[2], words(&shown, "20")[2]), ("1", "1"));
        // A request for reports of map 2.1 ends the reports of map 2.2 (M4).
        succeeded(arm.sevenbot(&["set", "angle-feedback-frequency", "10"]));
        stored(arm, &["set", "--unlock", "options", "0"]);
        let shown = succeeded(arm.sevenbot(&["get", "53", "82"]));
        assert_eq!((words(&shown, "53")[2], words(&shown, "82")[2]), ("0", "10"));
        succeeded(arm.sevenbot(&["set", "82", "0"]));
        drop(held);
    });
}

#[test]
fn registers_of_map_21_are_known_by_name() {
    with_arm(TestSetup::any(), |arm| {
        let wrist = ["set", "wrist-position", "4", "100", "4", "200", "4", "150"];
        let shown = succeeded(arm.sevenbot(&wrist));
        assert!(shown.contains("100 200 150 mm"), "{shown}");
        assert_eq!(arm.read(TARGET_POSITION, 3), [63, 90, 85], "the arm solved IK5");
        let far = failed(&arm.sevenbot(&["set", "wrist-position", "5", "144", "4", "0", "4", "100"]), 1);
        assert!(far.contains("no joint angles reach the position"), "{far}");
        assert_eq!(arm.read(LAST_REFUSAL, 2), [6, 68]);
        succeeded(arm.sevenbot(&["set", "disc-direction", "1", "2", "3"]));
        succeeded(arm.sevenbot(&["set", "tool-direction", "4", "5"]));
        assert_eq!(arm.read(61, 5), [4, 5, 1, 2, 3]);
        let shown = succeeded(arm.sevenbot(&["get", "present-load", "present-angle.1", "wrist-position"]));
        assert_eq!((words(&shown, "83")[1], words(&shown, "91")[1]), ("present-angle.1", "present-load.1"));
        let range = failed(&arm.sevenbot(&["set", "load-feedback-frequency", "101"]), 2);
        assert!(range.contains("load-feedback-frequency takes 0 to 100"), "{range}");
        // The same with `--map 2.1`, where function 04 writes all registers.
        stored(arm, &["--map", "2.1", "set", "--unlock", "options", "0"]);
        arm.drive_to(&STANDARD_POSE);
    });
}
