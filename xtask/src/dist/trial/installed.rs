//! Programs and wheels, installed on a bare system and on this one.

use std::fs;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use super::bare_root::BareRoot;
use crate::dist::contents::archive_name;
use crate::dist::platform::{PLATFORMS, host_platform};
use crate::dist::release::Release;
use crate::dist::{debian, wheels};
use crate::python::OLDEST;
use crate::run::{TaskResult, run_command};
use crate::venv;

/// What a user does in the first minute. `$VERSION`: the version that the programs have to print.
const FIRST_MINUTE: &str = r#"
for tool in cc gcc c++ rustc cargo; do
    if command -v $tool; then echo "this system is not bare"; exit 1; fi
done
test "$(sevenbot --version)" = "sevenbot $VERSION"
test "$(host-sim --version)" = "host-sim $VERSION"
sevenbot --port sim info
sevenbot --port sim pose 120 90 65 90 90 90 80 --wait
sevenbot --port sim record moments.txt --driven --yes --seconds 1
test "$(wc -l < moments.txt)" -gt 10
rm -f ready
host-sim --quiet --eeprom none --control none --link /root/7bot > ready &
for second in 1 2 3 4 5 6 7 8 9 10; do test -s ready || sleep 1; done
sevenbot --port /root/7bot pose 90 90 65 90 90 90 60 --wait
kill $!
"#;
/// Unpacks the archive as packaging/README.txt says. `$ARCHIVE`: its name.
const FROM_ARCHIVE: &str = r#"
mkdir .local
tar xzf /release/$ARCHIVE -C .local --strip-components=1
PATH=/root/.local/bin:$PATH
"#;
/// Lists all files, then installs the package and checks some of its files. `$PACKAGE`: its name.
const FROM_PACKAGE: &str = r#"
all_files() { find / -xdev -not -path '/proc/*' -not -path '/dev/*' -not -path '/root/*' -not -path '/var/lib/dpkg/*' \
    -not -path '/var/log/*' -not -path '/var/cache/*' | sort; }
all_files > before
dpkg --install /release/$PACKAGE
test -s /usr/share/man/man1/sevenbot-pose.1.gz
test -s /usr/share/man/man1/host-sim.1.gz
test -s /usr/share/bash-completion/completions/sevenbot
test -s /usr/lib/udev/rules.d/70-sevenbot.rules
test -s /usr/share/doc/sevenbot/copyright
"#;
/// Removes the package, and checks that no file of it is left.
const PURGED: &str = "
dpkg --remove sevenbot
dpkg --purge sevenbot
all_files > after
diff before after
";
/// What a user of the module does in the first minute.
pub(super) const FIRST_PROGRAM: &str = "
import sevenbot, sys, tempfile, os
arm = sevenbot.Arm.simulated(seed=7)
arm.sleep(1)
angles = arm.pose(120, 90, 65, 90, 90, 90, 80)
assert abs(angles[0] - 120) < 2, angles
path = os.path.join(tempfile.mkdtemp(), 'moments.txt')
arm.record(seconds=1).save(path)
assert len(sevenbot.Recording.load(path)) > 10
print(sys.version.split()[0], 'posed and recorded')
";

/// Tries the archive and the package for this computer, one after the other on the same bare system.
pub(super) fn programs(release: &Release) -> TaskResult {
    let platform = host_platform()?;
    let (archive, package) =
        (archive_name(release, platform), debian::name(release, platform.debian.unwrap_or_default()));
    let version = release.text();
    let root = BareRoot::with(&[release.path(&archive), release.path(&package)])?;
    let set = format!("VERSION='{version}'\nARCHIVE={archive}\nPACKAGE={package}\n");
    println!("{archive}");
    root.run(&format!("{set}{FROM_ARCHIVE}{FIRST_MINUTE}rm -r /root/.local"))?;
    println!("{package}");
    root.run(&format!("{set}{FROM_PACKAGE}{FIRST_MINUTE}{PURGED}"))
}

/// Checks with `lintian` that the Debian packages have no errors.
pub(super) fn packages_are_flawless(release: &Release) -> TaskResult {
    for debian in PLATFORMS.iter().filter_map(|platform| platform.debian) {
        let mut lintian = Command::new("lintian");
        run_command(
            lintian
                .args(["--allow-root", "--fail-on", "error"])
                .arg(release.path(&debian::name(release, debian))),
        )?;
    }
    Ok(())
}

/// Tries the wheel for this computer: in the Python of a bare system, and in each Python of this computer from [`OLDEST`] on.
pub(super) fn wheels(release: &Release) -> TaskResult {
    let name = wheels::wheel(release, host_platform()?);
    let wheel = release.path(&name);
    let root = BareRoot::with(std::slice::from_ref(&wheel))?;
    root.run(&format!("python3 -m venv v\nv/bin/pip install --quiet --no-index /release/{name}\nv/bin/python -c \"{FIRST_PROGRAM}\""))?;
    venv::of_this_computer()
        .iter()
        .filter(|(version, _)| *version >= OLDEST)
        .try_for_each(|(_, program)| try_wheel(program, &wheel))
}

fn try_wheel(program: &Path, wheel: &Path) -> TaskResult {
    let folder = TempDir::new()?;
    run_command(Command::new(program).args(["-m", "venv"]).arg(folder.path()))?;
    let python = folder.path().join("bin/python");
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-index"]);
    run_command(pip.arg(wheel))?;
    fs::create_dir(folder.path().join("empty"))?;
    run_command(Command::new(python).args(["-c", FIRST_PROGRAM]).current_dir(folder.path().join("empty")))
}
