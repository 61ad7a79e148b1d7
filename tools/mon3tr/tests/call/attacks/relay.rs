//! The server by way of another loopback address, as a client elsewhere reaches it.

use crate::house::House;
use std::net::{IpAddr, SocketAddr};
use tokio::net::{TcpListener, TcpSocket};
use tokio::task::JoinHandle;

/// A relay of TCP connections, until it is dropped.
pub(crate) struct Relay {
    pub(crate) address: SocketAddr,
    task: JoinHandle<()>,
}

impl Relay {
    /// Connections through it come from `source`, an address of this machine.
    pub(crate) fn from(house: &House, source: [u8; 4]) -> Self {
        let (server, source) = (house.address, IpAddr::from(source));
        let listener = TcpListener::bind(("127.0.0.1", 0));
        let listener = house.runtime.block_on(listener).expect("a port");
        let address = listener.local_addr().expect("bound");
        let task = house.runtime.spawn(async move {
            while let Ok((mut client, _)) = listener.accept().await {
                tokio::spawn(async move {
                    let socket = TcpSocket::new_v4()?;
                    socket.bind(SocketAddr::new(source, 0))?;
                    let mut server = socket.connect(server).await?;
                    tokio::io::copy_bidirectional(&mut client, &mut server).await
                });
            }
        });
        Self { address, task }
    }

    /// The same link to the server by way of the relay.
    pub(crate) fn link(&self, house: &House, link: &str) -> String {
        link.replace(&house.address.to_string(), &self.address.to_string())
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.task.abort();
    }
}
