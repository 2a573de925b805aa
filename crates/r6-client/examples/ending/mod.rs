//! Ctrl-C and SIGTERM: both end a program, and neither may leave an arm that continues with its list.

/// Waits for one of them. From its first poll they no longer kill the program.
#[cfg(unix)]
pub async fn told_to_end() {
    use tokio::signal::unix::{SignalKind, signal};
    match signal(SignalKind::terminate()) {
        Ok(mut terminate) => tokio::select! {
            _ = tokio::signal::ctrl_c() => {}
            _ = terminate.recv() => {}
        },
        // A system without signals may still have Ctrl-C.
        Err(_none) => drop(tokio::signal::ctrl_c().await),
    }
}

/// Waits for Ctrl-C.
#[cfg(not(unix))]
pub async fn told_to_end() {
    drop(tokio::signal::ctrl_c().await);
}
