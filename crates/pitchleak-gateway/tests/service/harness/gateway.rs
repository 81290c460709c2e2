use super::{Mosquitto, certificates, data, wait_until};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// The program, its configuration and its state.
pub struct Gateway {
    child: Option<Child>,
    listener: Option<JoinHandle<()>>,
    folder: tempfile::TempDir,
    /// What it said on standard error since it was started.
    pub said: Arc<Mutex<String>>,
}

const PROGRAM: &str = env!("CARGO_BIN_EXE_pitchleak-gateway");

impl Gateway {
    /// Not started yet. `change` makes the configuration another.
    pub fn new(broker: &Mosquitto, change: impl FnOnce(String) -> String) -> Self {
        Self::at(broker.tls_port, change)
    }

    /// With whatever broker is there.
    pub fn at(port: u16, change: impl FnOnce(String) -> String) -> Self {
        let folder = tempfile::tempdir().unwrap();
        write_secret(&folder.path().join("password"), "correct\n");
        let text = format!(
            "state = \"state\"\ncheckpoint_s = 0.2\n\
             [broker]\nhost = \"localhost\"\nport = {port}\nca_file = \"{}/authority.pem\"\nuser = \"tester\"\npassword_file = \"password\"\n\
             [[samples]]\ntopic = \"pitch/+/+/samples\"\nformat = \"json\"\n\
             [http]\nlisten = \"127.0.0.1:0\"\n\
             [watch]\nrig = \"{}/traces/rig.toml\"\nmost_cylinders = 50\n",
            certificates().display(),
            data().display()
        );
        std::fs::write(folder.path().join("gateway.toml"), change(text)).unwrap();
        Self { child: None, listener: None, folder, said: Arc::default() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn start(&mut self) {
        self.start_with(|command| command);
    }

    /// In an environment of its own, in its folder.
    pub fn start_with(&mut self, change: impl FnOnce(&mut Command) -> &mut Command) {
        let mut command = self.command();
        command.current_dir(self.folder.path()).stderr(Stdio::piped());
        let mut child = change(&mut command).spawn().unwrap();
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let said = Arc::clone(&self.said);
        said.lock().unwrap().clear();
        self.listener = Some(std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                said.lock().unwrap().push_str(&format!("{line}\n"));
            }
        }));
        self.child = Some(child);
    }

    /// As another says what it wants of it.
    pub fn start_as(&mut self, change: impl FnOnce(&mut Command) -> &mut Command) {
        self.child = Some(change(&mut self.command()).spawn().unwrap());
    }

    fn command(&self) -> Command {
        let mut command = Command::new(PROGRAM);
        command.arg(self.path("gateway.toml"));
        command
    }

    /// Waits until it says so.
    pub fn wait_for(&self, words: &str) {
        wait_until(words, || self.said.lock().unwrap().contains(words));
    }

    pub fn id(&self) -> u32 {
        self.child.as_ref().unwrap().id()
    }

    /// At any moment.
    pub fn kill(&mut self) {
        let mut child = self.child.take().unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
        self.listener.take().map(JoinHandle::join);
    }

    pub fn signal(&self, signal: &str) {
        Command::new("kill").args([signal, &self.id().to_string()]).status().unwrap();
    }

    /// By SIGTERM; its exit status.
    pub fn end(&mut self) -> Option<i32> {
        self.signal("-TERM");
        let mut child = self.child.take().unwrap();
        let status = child.wait().unwrap();
        self.listener.take().map(JoinHandle::join);
        status.code()
    }

    /// Where its page is.
    pub fn address(&self) -> String {
        let said = self.said.lock().unwrap().clone();
        format!("http://{}", said.split("http://").nth(1).unwrap().lines().next().unwrap())
    }

    /// What it answers to a request.
    pub fn get(&self, path: &str) -> String {
        let address = self.address();
        let mut connection = TcpStream::connect(address.trim_start_matches("http://")).unwrap();
        connection.write_all(format!("GET {path} HTTP/1.1\r\n\r\n").as_bytes()).unwrap();
        let mut text = String::new();
        connection.read_to_string(&mut text).unwrap();
        text
    }

    /// A metric's value.
    pub fn metric(&self, name: &str) -> f64 {
        let text = self.get("/metrics");
        let line = text.lines().find(|line| line.starts_with(name) && !line.starts_with('#'));
        line.and_then(|line| line.rsplit(' ').next()?.parse().ok())
            .unwrap_or_else(|| panic!("{name}: {text}"))
    }

    pub fn state(&self) -> PathBuf {
        self.path("state")
    }

    /// The highest that its memory was, bytes.
    pub fn peak_memory(&self) -> u64 {
        let text =
            std::fs::read_to_string(Path::new("/proc").join(self.id().to_string()).join("status")).unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
        1024 * line.trim().trim_end_matches(" kB").parse::<u64>().unwrap()
    }
}

/// That nobody else can read.
pub fn write_secret(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600)).unwrap();
}

impl Drop for Gateway {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
