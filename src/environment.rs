//! The environment that drivers find.

/// Where Mesa's drivers would complain about a variable that machines without a desktop do not have, begins the program anew
/// with it. The line, `error: XDG_RUNTIME_DIR is invalid or not set in the environment`, comes from Wayland's library,
/// once for every look at the adapters, and reads as if it were ours.
#[cfg(target_os = "linux")]
pub(crate) fn without_complaints() {
    use std::os::unix::process::CommandExt;
    use std::path::Path;
    use std::process::Command;

    const VARIABLE: &str = "XDG_RUNTIME_DIR";
    /// A path at which nobody listens.
    const NOWHERE: &str = "/nonexistent";
    if std::env::var_os(VARIABLE).is_some_and(|folder| Path::new(&folder).is_absolute()) {
        return;
    }
    let Ok(program) = std::env::current_exe() else { return };
    let mut arguments = std::env::args_os();
    let mut again = Command::new(program);
    if let Some(name) = arguments.next() {
        again.arg0(name);
    }
    // It returns only where that fails; then the lines appear.
    let _ = again.args(arguments).env(VARIABLE, NOWHERE).exec();
}

/// Elsewhere nobody complains.
#[cfg(not(target_os = "linux"))]
pub(crate) fn without_complaints() {}
