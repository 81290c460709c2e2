//! The disk is full.

use crate::harness::{Gateway, Mosquitto, Sender, TRACE, batches, state, undisturbed, wait_until};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A file system of 1 MiB in memory.
struct SmallDisk(PathBuf);

impl SmallDisk {
    /// None, and a word about it, where the tests may not mount one.
    fn mount(at: &Path) -> Option<Self> {
        fs::create_dir(at).unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=1m", "pitchleak-test"]).arg(at);
        if mount.status().is_ok_and(|status| status.success()) {
            return Some(Self(at.to_owned()));
        }
        eprintln!("skipped: no file system can be mounted");
        None
    }

    fn ballast(&self) -> PathBuf {
        self.0.join("ballast")
    }

    /// Until not a byte is left.
    fn fill(&self) {
        let mut ballast = File::create(self.ballast()).unwrap();
        while ballast.write_all(&[0; 4096]).is_ok() {}
    }

    fn free(&self) {
        fs::remove_file(self.ballast()).unwrap();
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("--lazy").arg(&self.0).status();
    }
}

#[test]
fn on_a_full_disk_it_goes_on_acknowledges_nothing_and_recovers() {
    let Some(broker) = Mosquitto::start("max_inflight_messages 0") else { return };
    let mut gateway = Gateway::new(&broker, |text| text);
    let Some(disk) = SmallDisk::mount(&gateway.state()) else { return };
    let cylinder = ["T0/B0".to_owned()];
    let batches = batches(TRACE, 100);
    let mut sender = Sender::new(broker.port);
    let mut send = |batches: &[String]| {
        batches.iter().for_each(|batch| sender.send("pitch/T0/B0/samples", batch.as_bytes()));
        sender.flush();
    };
    let is_well = |gateway: &Gateway| gateway.get("/health").contains("200 OK");
    gateway.start();
    gateway.wait_for("connected");
    send(&batches[..1]);
    let (first, _) = undisturbed(&cylinder, &batches[..1]);
    wait_until("a checkpoint", || state(&gateway.state()) == first);

    disk.fill();
    send(&batches[1..20]);
    wait_until("estimates go on", || gateway.metric("pitchleak_estimates_total") >= 19.0);
    wait_until("that is told", || gateway.get("/health").contains("no checkpoint"));
    gateway.wait_for("checkpoint: cannot write");
    wait_until("it tries again", || gateway.metric("pitchleak_checkpoint_failures_total") >= 3.0);
    wait_until("all were taken in", || gateway.metric("pitchleak_unacknowledged") >= 19.0);
    assert!(gateway.said.lock().unwrap().matches("checkpoint: ").count() == 1);
    assert_eq!(state(&gateway.state()), first);

    // Killed, it begins on the full disk where it was.
    gateway.kill();
    gateway.start();
    gateway.wait_for("connected");
    wait_until("all came again", || gateway.metric("pitchleak_unacknowledged") >= 19.0);
    assert_eq!(state(&gateway.state()), first);

    disk.free();
    let (expected, _) = undisturbed(&cylinder, &batches[..20]);
    wait_until("all is on the disk", || state(&gateway.state()) == expected);
    wait_until("all is acknowledged", || gateway.metric("pitchleak_unacknowledged") < 0.5);
    wait_until("it is well", || is_well(&gateway));
    send(&batches[20..]);
    let (expected, _) = undisturbed(&cylinder, &batches);
    wait_until("the state is that of the undisturbed run", || state(&gateway.state()) == expected);
    assert_eq!(gateway.end(), Some(0));
}

/// Its thread has a lower priority than that of the samples, which may have to share a core with it.
#[test]
fn checkpoints_give_way_to_samples() {
    let Some(broker) = Mosquitto::start("") else { return };
    let mut gateway = Gateway::new(&broker, |text| text);
    gateway.start();
    gateway.wait_for("connected");
    let tasks = std::fs::read_dir(format!("/proc/{}/task", gateway.id())).unwrap();
    let stats = tasks.map(|task| std::fs::read_to_string(task.unwrap().path().join("stat")).unwrap());
    // After the name in brackets, the 17th field is the niceness (proc(5)).
    let niceness = |stat: &str| stat.rsplit(')').next()?.split(' ').nth(17)?.parse::<i32>().ok();
    let (savers, others): (Vec<_>, Vec<_>) = stats.partition(|stat| stat.contains("(saver)"));
    assert_eq!(savers.len(), 1);
    let others: Vec<_> = others.iter().map(|stat| niceness(stat).unwrap()).collect();
    let saver = niceness(&savers[0]).unwrap();
    assert!(others.iter().all(|other| saver == (other + 10).min(19)), "{saver} {others:?}");
    assert_eq!(gateway.end(), Some(0));
}
