//! systemd's watchdog: a process whose tasks no longer run is started again (`sd_notify(3)`, `WatchdogSec=`).

use std::ffi::OsString;
use std::io;
use std::os::unix::net::UnixDatagram;
use std::time::Duration;

/// Reports, as long as it is polled, that this process lives, where systemd asks for that.
pub(super) async fn report() -> std::convert::Infallible {
    if let Some((socket, period)) = asked(|name| std::env::var_os(name)) {
        loop {
            if let Err(error) = send(&socket) {
                log::error!("systemd's watchdog cannot be reached: {error}");
            }
            // Twice a period.
            tokio::time::sleep(period / 2).await;
        }
    }
    std::future::pending().await
}

/// Where to report, and how often at least.
fn asked(variable: impl Fn(&str) -> Option<OsString>) -> Option<(OsString, Duration)> {
    let number = |name: &str| variable(name)?.to_str()?.parse::<u64>().ok();
    let is_other = number("WATCHDOG_PID").is_some_and(|pid| pid != u64::from(std::process::id()));
    let period = number("WATCHDOG_USEC").filter(|period| *period > 0 && !is_other)?;
    Some((variable("NOTIFY_SOCKET")?, Duration::from_micros(period)))
}

fn send(socket: &OsString) -> io::Result<()> {
    const ALIVE: &[u8] = b"WATCHDOG=1";
    let from = UnixDatagram::unbound()?;
    #[cfg(target_os = "linux")]
    if let Some(name) = socket.to_str().and_then(|name| name.strip_prefix('@')) {
        use std::os::linux::net::SocketAddrExt;
        let address = std::os::unix::net::SocketAddr::from_abstract_name(name)?;
        return from.send_to_addr(ALIVE, &address).map(drop);
    }
    from.send_to(ALIVE, socket).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_process_that_systemd_asks_reports() {
        let of = |period: &'static str, pid: Option<String>| {
            asked(move |name| match name {
                "NOTIFY_SOCKET" => Some("/run/notify".into()),
                "WATCHDOG_USEC" => Some(period.into()),
                "WATCHDOG_PID" => pid.clone().map(Into::into),
                _ => None,
            })
        };
        let wanted = Some(("/run/notify".into(), Duration::from_secs(20)));
        assert_eq!(of("20000000", None), wanted);
        assert_eq!(of("20000000", Some(std::process::id().to_string())), wanted);
        assert_eq!(of("20000000", Some("1".into())), None, "another process");
        assert_eq!(of("0", None), None);
        assert_eq!(of("soon", None), None);
        assert_eq!(asked(|_| None), None);
    }
}
