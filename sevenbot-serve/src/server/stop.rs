//! How another thread ends the server.

use std::sync::Arc;

use tokio::sync::Notify;

/// Ends a server from another thread, such as that of a signal. Copies end the same server.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<Notify>);

impl Stop {
    /// Ends the server, or the next one that runs with this.
    pub fn stop(&self) {
        self.0.notify_one();
    }

    /// Ends after [`Stop::stop`].
    pub(super) async fn stopped(&self) {
        self.0.notified().await;
    }
}
