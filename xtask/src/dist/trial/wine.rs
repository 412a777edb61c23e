//! `sevenbot.exe` in Wine: with the arm inside the program, and with the simulator's port as COM7.
//!
//! Wine 8 has no `bcryptprimitives.dll`, from which Rust's standard library takes random numbers. The test builds a substitute.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use system_tests::terminal::{Terminal, picture};
use tempfile::TempDir;

use crate::dist::contents::archive_name;
use crate::dist::platform::{LINUX_X86_64, WINDOWS};
use crate::dist::release::Release;
use crate::run::{ChildProcess, TaskResult, run_command, wait_for};

/// Random numbers from the function that Wine has.
const STAND_IN: &str = "
typedef unsigned char BOOLEAN;
__declspec(dllimport) BOOLEAN __stdcall SystemFunction036(void *, unsigned long);
__declspec(dllexport) int __stdcall ProcessPrng(unsigned char *to, unsigned long long count)
{ return SystemFunction036(to, (unsigned long)count); }
";
const JOINTS: usize = 7;
const COMPILER: &str = "x86_64-w64-mingw32-gcc";
/// The timeout of a program in Wine, in seconds: the server of Wine may wait for ever.
const LONGEST: &str = "600";

/// Wine, with files of its own, and the program.
struct Wine {
    folder: TempDir,
}

pub(super) fn programs(release: &Release) -> TaskResult {
    let wine = Wine::with(&release.path(&archive_name(release, WINDOWS)))?;
    let version = wine.output(&["--version"])?;
    if version.trim() != format!("sevenbot {}", release.text()) {
        return Err(format!("sevenbot.exe says {version:?}").into());
    }
    wine.first_minute("sim")?;
    let (_simulator, port) = simulator(release, wine.folder.path())?;
    wine.connect(&port)?;
    wine.first_minute("COM7")?;
    wine.sevenbot(&["--port", "COM7", "play", "moments.txt", "--approach", "3"])?;
    wine.monitor("COM7")
}

impl Wine {
    /// Unpacks the archive, and makes an empty Windows.
    fn with(archive: &Path) -> TaskResult<Self> {
        let wine = Self { folder: TempDir::new()? };
        let folder = wine.folder.path();
        let mut unzip = Command::new("python3");
        run_command(unzip.args(["-m", "zipfile", "-e"]).arg(archive).arg(folder))?;
        let unpacked = fs::read_dir(folder)?.next().ok_or("the archive is empty")??.path();
        fs::rename(unpacked, folder.join("programs"))?;
        let source = folder.join("random.c");
        fs::write(&source, STAND_IN)?;
        let mut compiler = Command::new(COMPILER);
        compiler.arg("-shared").arg("-o").arg(folder.join("programs/bcryptprimitives.dll"));
        run_command(compiler.arg(source).arg("-ladvapi32"))?;
        run_command(wine.command("wineboot").arg("--init").stdout(Stdio::null()).stderr(Stdio::null()))?;
        Ok(wine)
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new("timeout");
        command.args(["--foreground", LONGEST, program]);
        command.envs(self.variables()).current_dir(self.folder.path());
        command
    }

    fn variables(&self) -> [(&'static str, String); 3] {
        [
            ("WINEPREFIX", self.folder.path().join("wine").display().to_string()),
            ("WINEDEBUG", "-all".to_owned()),
            ("WINEDLLOVERRIDES", "mscoree,mshtml=".to_owned()),
        ]
    }

    fn sevenbot_command(&self, arguments: &[&str]) -> Command {
        let mut command = self.command("wine");
        command.arg("programs/sevenbot.exe").args(arguments);
        command
    }

    fn sevenbot(&self, arguments: &[&str]) -> TaskResult {
        run_command(&mut self.sevenbot_command(arguments))
    }

    fn output(&self, arguments: &[&str]) -> TaskResult<String> {
        let output = self.sevenbot_command(arguments).stderr(Stdio::inherit()).output()?;
        if output.status.success() {
            Ok(String::from_utf8(output.stdout)?)
        } else {
            Err(format!("{arguments:?} failed").into())
        }
    }

    fn first_minute(&self, port: &str) -> TaskResult {
        println!("sevenbot.exe --port {port}");
        let file = self.folder.path().join("moments.txt");
        let _ = fs::remove_file(&file);
        self.sevenbot(&["--port", port, "info"])?;
        self.sevenbot(&["--port", port, "pose", "120", "90", "65", "90", "90", "90", "80", "--wait"])?;
        self.sevenbot(&["--port", port, "record", "moments.txt", "--driven", "--yes", "--seconds", "1"])?;
        let lines = fs::read_to_string(file)?.lines().count();
        if lines > 10 { Ok(()) } else { Err(format!("{lines} lines were recorded").into()) }
    }

    /// Checks that the monitor draws seven joints, and that the key q ends it.
    fn monitor(&self, port: &str) -> TaskResult {
        let program = self.folder.path().join("programs/sevenbot.exe").display().to_string();
        let variables: Vec<_> =
            self.variables().iter().map(|(name, value)| format!("{name}={value}")).collect();
        let mut words: Vec<&str> = variables.iter().map(String::as_str).collect();
        words.extend(["wine", &program, "--port", port, "monitor"]);
        let mut terminal = Terminal::run(Path::new("env"), &words);
        let drawn = wait_for("the joints on the screen", || {
            let drawn = picture(&without_console(&terminal.output()));
            let has_joints =
                drawn.contains("joint  target  position") && drawn.matches('●').count() == JOINTS;
            Ok(has_joints.then_some(drawn))
        })?;
        println!("{drawn}");
        terminal.keys("q");
        if terminal.wait().success() { Ok(()) } else { Err("the monitor failed".into()) }
    }

    /// Makes a terminal of Linux the port COM7.
    fn connect(&self, terminal: &Path) -> TaskResult {
        let key = ["reg", "add", r"HKLM\Software\Wine\Ports", "/v", "COM7", "/d"];
        run_command(self.command("wine").args(key).arg(terminal).arg("/f").stdout(Stdio::null()))?;
        run_command(self.command("wineserver").arg("--kill"))?;
        let link = self.folder.path().join("wine/dosdevices/com7");
        let _ = fs::remove_file(&link);
        Ok(symlink(terminal, link)?)
    }
}

/// The output of a program without the additions of the console of Wine 8. This console treats escape sequences as text: it
/// begins a new row after each 80 characters, and sometimes draws the present row again.
fn without_console(output: &[u8]) -> Vec<u8> {
    const NEW_ROW: &[u8] = b"\r\r\n";
    const ROW_AGAIN: &[u8] = b"\x1b[K\x1b[?25h\x1b[?25l\r";
    let (mut written, mut row, mut rest) = (Vec::new(), Vec::new(), output);
    while let Some((&byte, after)) = rest.split_first() {
        if let Some(after) = rest.strip_prefix(NEW_ROW) {
            written.append(&mut row);
            rest = after;
        } else if let Some(after) = rest.strip_prefix(ROW_AGAIN) {
            rest = after.strip_prefix(row.as_slice()).unwrap_or(after);
        } else {
            row.push(byte);
            rest = after;
        }
    }
    written.append(&mut row);
    written
}

/// Starts the simulator of the release on this computer. Returns its process and its port.
fn simulator(release: &Release, folder: &Path) -> TaskResult<(ChildProcess, PathBuf)> {
    let mut tar = Command::new("tar");
    tar.args(["--extract", "--directory"]).arg(folder).arg("--file");
    run_command(tar.arg(release.path(&archive_name(release, LINUX_X86_64))))?;
    let name = format!("sevenbot-{}-{}/bin/host-sim", release.version, LINUX_X86_64.name);
    let link = folder.join("7bot");
    let mut command = Command::new(folder.join(name));
    command.args(["--quiet", "--eeprom", "none", "--control", "none", "--link"]).arg(&link);
    let child = ChildProcess(command.stdout(Stdio::null()).spawn()?);
    wait_for("the port of the simulator", || Ok(link.exists().then_some(())))?;
    Ok((child, fs::canonicalize(link)?))
}
