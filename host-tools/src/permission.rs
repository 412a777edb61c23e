//! Who may open a port: the group its file belongs to, where ports are files and groups have names.
//!
//! Only asked once opening has failed.

/// The name of the group a port's file belongs to; `None` where the system does not say.
#[cfg(unix)]
pub(crate) fn group_of(path: &str) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    let number = std::fs::metadata(path).ok()?.gid();
    name_in(&std::fs::read_to_string("/etc/group").ok()?, number)
}

/// The name of the group a port's file belongs to; `None` where the system does not say.
#[cfg(not(unix))]
pub(crate) fn group_of(_: &str) -> Option<String> {
    None
}

/// The name of a group in a file like /etc/group: `name:password:number:members`.
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
