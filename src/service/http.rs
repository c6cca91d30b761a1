//! The HTTP port: connections taken, so many at once at most, each with little time to say what it wants; axum's own server has neither
//! bound.

use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// Connections at once; the files of the process are the dump port's and the store's too. WebSocket clients have a bound of their own.
const CONNECTIONS_MAX: usize = 256;
/// A connection has this long for the head of its next request.
const HEAD_PATIENCE: Duration = Duration::from_secs(10);
/// When the system has no connection to give, as when the process has too many files open.
const ACCEPT_RETRY: Duration = Duration::from_millis(100);

/// Serves a router until `closing`, and then what is under way.
pub async fn serve(listener: TcpListener, router: Router, closing: CancellationToken) {
    let service = TowerToHyperService::new(router);
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(HEAD_PATIENCE);
    let connections = TaskTracker::new();
    let room = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    let next = async || {
        let permit = room.clone().acquire_owned().await.expect("it is never closed");
        loop {
            match listener.accept().await {
                Ok((stream, _)) => return (stream, permit),
                Err(error) => {
                    tracing::warn!(%error, "an HTTP connection could not be taken");
                    tokio::time::sleep(ACCEPT_RETRY).await;
                }
            }
        }
    };
    while let Some((stream, permit)) = closing.run_until_cancelled(next()).await {
        let _ = stream.set_nodelay(true);
        let connection = builder.serve_connection(TokioIo::new(stream), service.clone()).with_upgrades();
        let closing = closing.clone();
        connections.spawn(async move {
            let mut connection = pin!(connection);
            // A client that breaks off is no fault of the service.
            if closing.run_until_cancelled(connection.as_mut()).await.is_none() {
                connection.as_mut().graceful_shutdown();
                let _ = connection.await;
            }
            drop(permit);
        });
    }
    connections.close();
    connections.wait().await;
}
