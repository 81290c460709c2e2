use super::{certificates, wait_until};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Mosquitto with TLS and a password on one port, and open on another, for the tests' own clients.
pub struct Mosquitto {
    child: Child,
    folder: tempfile::TempDir,
    pub tls_port: u16,
    pub port: u16,
}

impl Mosquitto {
    /// None, and a word about it, where it is not installed.
    pub fn start(more: &str) -> Option<Self> {
        let paths = ["/usr/sbin/mosquitto", "/usr/local/sbin/mosquitto", "/usr/bin/mosquitto"];
        if !paths.iter().any(|path| Path::new(path).exists()) {
            eprintln!("skipped: mosquitto is not installed");
            return None;
        }
        let (tls_port, port) = (free_port(), free_port());
        let folder = tempfile::tempdir().unwrap();
        let at = certificates().display().to_string();
        let store = folder.path().display();
        let text = format!(
            "per_listener_settings true\nuser root\n\
             listener {tls_port} 127.0.0.1\ncafile {at}/authority.pem\ncertfile {at}/broker.pem\nkeyfile {at}/broker.key\n\
             allow_anonymous false\npassword_file {at}/passwords\nset_tcp_nodelay true\n\
             listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n\
             persistence true\npersistence_location {store}/\nmax_queued_messages 100000\n{more}\n"
        );
        std::fs::write(folder.path().join("mosquitto.conf"), text).unwrap();
        let child = spawn(folder.path(), port);
        Some(Self { child, folder, tls_port, port })
    }

    /// As if the network were cut: nothing comes through, and nobody is told.
    pub fn cut(&self) {
        self.signal("-STOP");
    }

    pub fn mend(&self) {
        self.signal("-CONT");
    }

    fn signal(&self, signal: &str) {
        Command::new("kill").args([signal, &self.child.id().to_string()]).status().unwrap();
    }

    /// Ends it in order, so that it keeps what it has, and starts it again.
    pub fn restart(&mut self) {
        Command::new("kill").arg(self.child.id().to_string()).status().unwrap();
        self.child.wait().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(300));
        self.revive();
    }

    /// By `kill -9`.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Starts it again.
    pub fn revive(&mut self) {
        self.child = spawn(self.folder.path(), self.port);
    }
}

/// That nobody listens on now.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn spawn(folder: &Path, port: u16) -> Child {
    let mut command = Command::new("sh");
    // Its folder is not on everybody's PATH.
    command.args(["-c", "PATH=$PATH:/usr/sbin:/usr/local/sbin exec mosquitto -c \"$0\""]);
    command.arg(folder.join("mosquitto.conf")).stdout(Stdio::null()).stderr(Stdio::null());
    let child = command.spawn().unwrap();
    wait_until("mosquitto listens", || TcpStream::connect(("127.0.0.1", port)).is_ok());
    child
}

impl Drop for Mosquitto {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
