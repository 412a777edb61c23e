//! The group that may open a port, where ports are files.

/// The mode bits with which the group of a file may read and write it.
#[cfg(unix)]
const GROUP_READS_AND_WRITES: u32 = 0o060;

/// The name of the group that may open a port; `None` if there is none, or the system does not tell.
#[cfg(unix)]
pub(crate) fn group_of(path: &str) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    let file = std::fs::metadata(path).ok()?;
    let may_open = file.mode() & GROUP_READS_AND_WRITES == GROUP_READS_AND_WRITES;
    may_open.then(|| name_in(&std::fs::read_to_string("/etc/group").ok()?, file.gid()))?
}

/// `None`: ports are not files here.
#[cfg(not(unix))]
pub(crate) fn group_of(_: &str) -> Option<String> {
    None
}

/// The name of a group, from a file like /etc/group: `name:password:number:members`.
#[cfg(unix)]
fn name_in(groups: &str, number: u32) -> Option<String> {
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        let is_it = fields.nth(1)?.parse() == Ok(number);
        is_it.then(|| name.to_owned())
    })
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn groups_are_found_by_their_number() {
        let groups = "root:x:0:\n# no group\ndialout:x:20:ann,ben\nbroken\n";
        assert_eq!(name_in(groups, 20).as_deref(), Some("dialout"));
        assert_eq!(name_in(groups, 21), None);
        assert_eq!(group_of("/dev/null").as_deref(), Some("root"));
    }
}
