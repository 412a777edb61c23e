//! `sevenbot record --mcap` and `convert`: recordings for other programs.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};

use super::motion::{WAVE, file, moments, text};
use super::output::{failed, run_without_arm, succeeded};
use system_tests::process::{RunningProgram, Signal, send_signal};
use system_tests::programs::{TOOL_TIMEOUT, sevenbot, tool};
use system_tests::registers::FEEDBACK_FREQUENCY;
use system_tests::terminal::Terminal;
use system_tests::wait::wait_until;
use system_tests::{TestSetup, with_arm};

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |facts| facts.len())
}

/// Does the file contain this text?
fn holds(path: &Path, text: &str) -> bool {
    fs::read(path).expect("a file").windows(text.len()).any(|part| part == text.as_bytes())
}

#[test]
fn both_files_of_a_recording_have_the_same_moments() {
    with_arm(TestSetup::any(), |arm| {
        let (folder, recorded) = file("both.txt", "");
        let [mcap, again] = ["both.mcap", "again.txt"].map(|name| folder.path().join(name));
        let record =
            ["record", text(&recorded), "--mcap", text(&mcap), "--driven", "--seconds", "2", "--json"];
        let said = succeeded(arm.sevenbot(&record));
        assert!(said.contains("both.txt\",\"mcap\":\"") && said.contains("\"moments\":"), "{said}");
        succeeded(run_without_arm(&["convert", text(&mcap), text(&again)]));
        assert!(moments(&recorded).len() > 20, "{}", moments(&recorded).len());
        assert_eq!(moments(&recorded), moments(&again));
        for topic in ["/joint_states", "/robot_joint_command", "/tf", "/diagnostics", "healthy"] {
            assert!(holds(&mcap, topic), "{topic}");
        }
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0, "reports are off again");
        succeeded(arm.sevenbot(&["play", text(&mcap)]));
        let refused = failed(&arm.sevenbot(&["record", "--mcap", text(&mcap), "--driven"]), 2);
        assert!(refused.contains("both.mcap exists. Replace it?"), "{refused}");
    });
}

#[test]
fn a_program_reads_a_recording_while_it_is_written() {
    with_arm(TestSetup::any(), |arm| {
        let mut tool = arm.spawn_sevenbot(&["record", "--mcap", "-", "--driven"]);
        let mut output = tool.stdout.take().expect("a pipe");
        // More bytes than the tool writes before the first moment, so they arrive during the recording.
        let mut bytes = vec![0; 30_000];
        output.read_exact(&mut bytes).expect("moments");
        send_signal(&tool, Signal::INT);
        output.read_to_end(&mut bytes).expect("the rest");
        let said = succeeded(tool.output());
        assert_eq!(said, "", "nothing else is written to standard output");
        assert!(bytes.starts_with(&MAGIC) && bytes.ends_with(&MAGIC));
        let (folder, live) = file("live.mcap", "");
        fs::write(&live, bytes).expect("a file");
        let again = folder.path().join("live.csv");
        succeeded(run_without_arm(&["convert", text(&live), text(&again)]));
        assert!(fs::read_to_string(&again).expect("CSV").lines().count() > 10);
        let whole = folder.path().join("whole.mcap");
        succeeded(run_without_arm(&["convert", text(&live), text(&whole)]));
        let piped = run_without_arm(&["convert", text(&live), "-", "--to", "mcap"]);
        assert_eq!(piped.stdout, fs::read(&whole).expect("MCAP"), "the same bytes through a pipe");
    });
}

#[test]
fn a_terminal_gets_no_bytes_of_a_binary_format() {
    let (_folder, wave) = file("wave.txt", WAVE);
    let record = ["--port", "sim", "record", "--mcap", "-", "--driven"];
    for command in [&record[..], &["convert", text(&wave), "-", "--to", "mcap"]] {
        let mut terminal = Terminal::run(sevenbot(), command);
        assert_eq!(terminal.wait().code(), Some(2), "{command:?}: {}", terminal.contents());
        assert!(terminal.contents().contains("a terminal cannot show mcap"), "{}", terminal.contents());
    }
}

#[test]
fn what_a_killed_recording_left_can_be_read() {
    with_arm(TestSetup::any(), |arm| {
        let (folder, mcap) = file("killed.mcap", "");
        let mut tool = arm.spawn_sevenbot(&["record", "--mcap", text(&mcap), "--driven"]);
        wait_until("two seconds are recorded", || length(&mcap) > 80_000);
        tool.kill();
        arm.reopen(115_200);
        arm.write(FEEDBACK_FREQUENCY, &[0]);
        let refused = failed(&arm.sevenbot(&["play", text(&mcap)]), 1);
        assert!(refused.contains("can be read: `sevenbot convert` writes them"), "{refused}");
        let again = folder.path().join("killed.txt");
        let said = failed(&run_without_arm(&["convert", text(&mcap), text(&again)]), 1);
        assert!(said.contains("the file ends in the middle: what can be read was converted"), "{said}");
        assert!(moments(&again).len() > 25, "{}", moments(&again).len());
        succeeded(arm.sevenbot(&["play", text(&again)]));
        let whole = folder.path().join("whole.mcap");
        failed(&run_without_arm(&["convert", text(&mcap), text(&whole)]), 1);
        assert!(
            holds(&whole, "/diagnostics") && holds(&whole, "/robot_joint_command"),
            "all topics are kept"
        );
        succeeded(arm.sevenbot(&["play", text(&whole)]));
    });
}

#[test]
fn a_full_disk_leaves_whole_moments_in_an_mcap_file() {
    with_arm(TestSetup::any(), |arm| {
        let (folder, mcap) = file("full.mcap", "");
        // Limits files to 128 or 256 KiB, depending on the shell, and ignores the signal at the limit.
        let limited = "trap '' XFSZ; ulimit -f 256; exec \"$0\" \"$@\"";
        let mut tool = Command::new("sh");
        tool.env(TOOL_TIMEOUT.0, TOOL_TIMEOUT.1).args(["-c", limited]).arg(sevenbot());
        tool.arg("--port").arg(arm.lend_port());
        let output = tool.args(["record", "--mcap", text(&mcap), "--driven", "--hz", "50"]).output();
        let error = failed(&output.expect("a shell"), 1);
        let (_, rest) = error.split_once("full.mcap has the first ").expect("how much is there");
        let there: usize =
            rest.split_whitespace().next().and_then(|word| word.parse().ok()).expect("a number");
        arm.reopen(115_200);
        let again = folder.path().join("full.txt");
        failed(&run_without_arm(&["convert", text(&mcap), text(&again)]), 1);
        assert!(there > 0 && moments(&again).len() == there, "{there}: {error}");
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0, "reports are off again");
    });
}

#[test]
fn recordings_are_converted_without_an_arm() {
    let (folder, wave) = file("wave.txt", WAVE);
    let path = |name: &str| folder.path().join(name).display().to_string();
    for (from, to) in [("wave.txt", "wave.mcap"), ("wave.mcap", "wave.csv"), ("wave.csv", "again.txt")] {
        let said = succeeded(run_without_arm(&["convert", &path(from), &path(to)]));
        assert!(said.contains(to) && said.contains("3 moments in 1.0 s"), "{said}");
    }
    assert_eq!(moments(&wave), moments(&folder.path().join("again.txt")));
    let csv = succeeded(run_without_arm(&["convert", &path("wave.mcap"), "-", "--to", "csv"]));
    assert_eq!(csv, fs::read_to_string(path("wave.csv")).expect("CSV"));
    let refused = |arguments: &[&str], status, says: &str| {
        let said = failed(&run_without_arm(arguments), status);
        assert!(said.contains(says), "{said}");
    };
    refused(&["convert", &path("wave.txt"), &path("wave.bag")], 2, "txt, csv, mcap) or use --to");
    refused(&["convert", &path("wave.txt"), "-"], 2, "tells no format");
    refused(&["convert", &path("wave.txt"), &path("wave.csv")], 1, "the file exists; --force replaces it");
    refused(&["convert", &path("wave.txt"), &path("wave.txt"), "--force"], 1, "the file that is read");
    refused(&["convert", "/dev/zero", &path("zero.csv")], 1, "not a recording");
    refused(&["record", &path("x.mcap")], 2, "for MCAP use --mcap");
    refused(&["record", &path("x.csv")], 2, "`sevenbot convert` makes");
    refused(&["record"], 2, "<FILE|--mcap <MCAP>>");
    assert!(!folder.path().join("zero.csv").exists() && !folder.path().join("x.mcap").exists());
}

/// The program that reads the recording from a pipe may end first.
#[test]
fn a_reader_that_ends_ends_the_recording_and_the_arm_holds() {
    with_arm(TestSetup::any(), |arm| {
        let mut recording = tool();
        recording.arg("--port").arg(arm.lend_port()).args(["record", "--mcap", "-", "--yes"]);
        recording.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut recording = RunningProgram::spawn(&mut recording);
        let mut output = recording.stdout.take().expect("a pipe");
        output.read_exact(&mut [0; 8]).expect("the first bytes");
        drop(output);
        let said = recording.output();
        assert_eq!(said.status.code(), Some(0), "as other commands whose reader ends");
        assert!(String::from_utf8_lossy(&said.stderr).contains("the arm holds where it is"));
        arm.reopen(115_200);
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0, "reports are off again");
    });
}
