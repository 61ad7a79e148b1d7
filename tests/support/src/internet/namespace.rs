//! A network namespace, and programs in it. A process without a task holds it: the kernel drops the namespace, with its interfaces and
//! rules, when that process and the programs in it have ended. Neither root nor a change of the machine is needed.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};

/// Where `MON3TR_IP` and `MON3TR_NFT` (`scripts/network-programs.sh`) say that programs lie; else their names.
pub(super) fn program(variable: &str, name: &str) -> OsString {
    std::env::var_os(variable)
        .filter(|path| !path.is_empty())
        .unwrap_or_else(|| name.into())
}

/// A network namespace.
#[derive(Debug)]
pub struct Namespace {
    /// Ends with this, and also when this process ends in any way: its standard input is then closed.
    holder: Child,
}

impl Namespace {
    /// A namespace in a new user namespace, in which this process's user is root.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub(super) fn first() -> Result<Self, String> {
        let mut unshare = Command::new("unshare");
        unshare.args(["--user", "--map-root-user", "--net", "--", "cat"]);
        Self::hold(&mut unshare).map_err(|why| {
            format!(
                "{why}: network namespaces without root need user namespaces; the sysctls kernel.unprivileged_userns_clone=1, \
                 user.max_user_namespaces>0 and kernel.apparmor_restrict_unprivileged_userns=0 allow them, where the kernel has them"
            )
        })
    }

    /// Another one in the same user namespace.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub(super) fn beside(&self) -> Result<Self, String> {
        let mut unshare = self.enter_by(&["--user"]);
        unshare.args(["unshare", "--net", "--", "cat"]);
        Self::hold(&mut unshare)
    }

    /// Starts a holder: it echoes a line once it is in its namespace.
    fn hold(command: &mut Command) -> Result<Self, String> {
        let child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let holder = child.map_err(|why| format!("{command:?}: {why}"))?;
        let mut namespace = Self { holder };
        let stdin = namespace.holder.stdin.as_mut().expect("piped");
        let asked = stdin.write_all(b"there\n");
        let stdout = namespace.holder.stdout.take().expect("piped");
        let mut line = String::new();
        let answered = BufReader::new(stdout).read_line(&mut line);
        if asked.is_ok() && answered.is_ok() && line == "there\n" {
            return Ok(namespace);
        }
        let mut why = String::new();
        let mut stderr = namespace.holder.stderr.take().expect("piped");
        // It has ended; without a word its command has to do.
        let _ = stderr.read_to_string(&mut why);
        Err(format!("{command:?}: {}", why.trim()))
    }

    /// The process by which the namespace is known.
    pub(super) fn id(&self) -> u32 {
        self.holder.id()
    }

    fn enter_by(&self, which: &[&str]) -> Command {
        let mut enter = Command::new("nsenter");
        enter
            .args(["--preserve-credentials", "--target"])
            .arg(self.id().to_string())
            .args(which)
            .arg("--");
        enter
    }

    /// `command`, with its arguments and environment, in this namespace. The process that is started becomes the command's.
    #[must_use]
    pub fn enter(&self, command: &Command) -> Command {
        let mut enter = self.enter_by(&["--user", "--net"]);
        enter.arg(command.get_program()).args(command.get_args());
        for (name, value) in command.get_envs() {
            match value {
                Some(value) => enter.env(name, value),
                None => enter.env_remove(name),
            };
        }
        enter
    }

    /// Runs `ip` with these lines, one command each.
    ///
    /// # Errors
    /// What it says.
    pub(super) fn ip(&self, lines: &[String]) -> Result<(), String> {
        let mut ip = Command::new(program("MON3TR_IP", "ip"));
        self.run(ip.args(["-batch", "-"]), &(lines.join("\n") + "\n"))
    }

    /// Loads rules.
    ///
    /// # Errors
    /// What `nft` says.
    pub(super) fn nft(&self, rules: &str) -> Result<(), String> {
        let mut nft = Command::new(program("MON3TR_NFT", "nft"));
        self.run(nft.args(["-f", "-"]), rules)
    }

    /// Has packets passed on between this namespace's interfaces.
    ///
    /// # Errors
    /// If the kernel or a container does not let it.
    pub(super) fn forward(&self) -> Result<(), String> {
        let mut write = Command::new("tee");
        self.run(write.arg("/proc/sys/net/ipv4/ip_forward"), "1\n")
    }

    fn run(&self, command: &Command, input: &str) -> Result<(), String> {
        let said = |why: &dyn std::fmt::Display| format!("{command:?}: {why}");
        let child = self
            .enter(command)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let mut child = child.map_err(|why| said(&why))?;
        let mut stdin = child.stdin.take().expect("piped");
        let written = stdin.write_all(input.as_bytes());
        drop(stdin);
        let output = child.wait_with_output().map_err(|why| said(&why))?;
        if !output.status.success() {
            return Err(said(&String::from_utf8_lossy(&output.stderr).trim()));
        }
        written.map_err(|why| said(&why))
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        let _ = self.holder.kill();
        let _ = self.holder.wait();
    }
}
