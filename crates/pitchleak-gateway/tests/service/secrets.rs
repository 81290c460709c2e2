//! Certificates of our own, credentials of systemd, and secrets that are none.

use crate::harness::{Gateway, Mosquitto, certificates, free_port, write_secret};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

#[test]
fn to_a_broker_that_wants_a_certificate_it_shows_its_own() {
    let port = free_port();
    let at = certificates().display().to_string();
    let more = format!(
        "listener {port} 127.0.0.1\ncafile {at}/authority.pem\ncertfile {at}/broker.pem\nkeyfile {at}/broker.key\n\
         require_certificate true\nuse_identity_as_username true\nallow_anonymous false"
    );
    let Some(_broker) = Mosquitto::start(&more) else { return };
    let login = "user = \"tester\"\npassword_file = \"password\"\n";
    let identity = format!(
        "client_cert_file = \"{at}/gateway.pem\"\nclient_key_file = \"$CREDENTIALS_DIRECTORY/gateway.key\"\n"
    );
    let mut without = Gateway::at(port, |text| text.replace(login, ""));
    without.start();
    without.wait_for("no_broker");
    assert!(!without.said.lock().unwrap().contains("connected;"));
    let mut with = Gateway::at(port, |text| text.replace(login, &identity));
    let key = fs::read_to_string(certificates().join("gateway.key")).unwrap();
    write_secret(&with.path("gateway.key"), &key);
    with.start_with(|command| command.env("CREDENTIALS_DIRECTORY", "."));
    with.wait_for("connected;");
    assert_eq!((with.end(), without.end()), (Some(0), Some(0)));
}

#[test]
fn a_secret_that_others_can_read_or_that_goes_over_the_network_is_warned_of() {
    let gateway = Gateway::at(1883, |text| {
        text.lines()
            .filter(|line| !line.contains("ca_file"))
            .collect::<Vec<_>>()
            .join("\n")
            .replace("[broker]", "[broker]\ntls = false")
    });
    fs::set_permissions(gateway.path("password"), fs::Permissions::from_mode(0o644)).unwrap();
    let check = Command::new(env!("CARGO_BIN_EXE_pitchleak-gateway"))
        .arg(gateway.path("gateway.toml"))
        .arg("--check-config")
        .output()
        .unwrap();
    let warned = String::from_utf8_lossy(&check.stderr);
    assert!(check.status.success(), "{warned}");
    assert!(warned.contains("others can read this secret (mode 644)"), "{warned}");
    assert!(warned.contains("the password goes over the network as it is"), "{warned}");
}

#[test]
fn help_that_nobody_gets_is_no_success() {
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let help =
        Command::new(env!("CARGO_BIN_EXE_pitchleak-gateway")).arg("--help").stdout(full).output().unwrap();
    assert_eq!(help.status.code(), Some(2));
}
