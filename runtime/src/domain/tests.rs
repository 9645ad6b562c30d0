use super::*;

/// Makes a namespace that no other test uses.
fn namespace(of: &str) -> String {
    format!("domain-{of}-{}", std::process::id())
}

#[test]
fn a_namespace_is_letters_digits_dashes_and_no_path() {
    for name in ["a", "Run_2", "a-b", &"x".repeat(40)] {
        assert!(check_name(name).is_ok(), "{name}");
    }
    for name in ["", ".", "..", "a/b", "a b", "\u{fc}", &"x".repeat(41)] {
        assert!(matches!(Hold::take(name), Err(DomainError::BadName(_))), "{name}");
        assert!(matches!(Domain::find(name), Err(DomainError::BadName(_))), "{name}");
    }
}

#[test]
fn a_namespace_is_taken_until_its_hold_is_dropped_and_nothing_is_left() {
    let name = namespace("taken");
    assert!(matches!(Domain::find(&name), Err(DomainError::NotRunning(_))));
    let hold = Hold::take(&name).unwrap();
    let domain = Domain::find(&name).unwrap();
    assert_eq!((domain.namespace(), domain.launcher_pid()), (name.as_str(), Some(std::process::id() as i32)));
    assert!(Domain::list().iter().any(|other| other.folder == domain.folder));
    assert!(matches!(Hold::take(&name), Err(DomainError::InUse(_))));
    drop(hold);
    assert!(matches!(Domain::find(&name), Err(DomainError::NotRunning(_))));
    assert!(Domain::left(&name).is_none());
}

#[test]
fn the_next_launcher_wipes_the_folder_of_a_killed_one() {
    let name = namespace("killed");
    let hold = Hold::take(&name).unwrap();
    let left = hold.domain.write("left", "over").unwrap();
    let Hold { domain, _lock: lock } = &hold;
    // Releases the lock as the kernel does when a process ends.
    flock(lock, FlockOperation::Unlock).unwrap();
    assert!(!domain.is_live() && domain.folder.is_dir());
    let next = Hold::take(&name).unwrap();
    assert!(!left.exists() && next.domain.is_live());
}

#[test]
fn a_file_of_a_run_is_private_and_never_overwritten() {
    let hold = Hold::take(&namespace("files")).unwrap();
    let path = hold.domain.write("note", "text").unwrap();
    assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
    assert!(hold.domain.write("note", "again").is_err(), "none is overwritten");
    assert!(hold.domain.files().contains(&(path, 4)));
}
