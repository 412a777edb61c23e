//! How another thread ends the server.

use std::sync::Arc;

use tokio::sync::Notify;

/// Ends a server from another thread, such as the thread of a signal handler. Copies end the same server.
#[derive(Clone, Debug, Default)]
pub struct ServerStop(Arc<Notify>);

impl ServerStop {
    /// Ends the server that runs with this stop. If none runs, the next one ends at once.
    pub fn stop(&self) {
        self.0.notify_one();
    }

    /// Ends after [`ServerStop::stop`].
    pub(super) async fn stopped(&self) {
        self.0.notified().await;
    }
}
