//! MQTT 5 by the crate rumqttc, in a thread of its own that waits for the network alone.

use crate::Failure;
use crate::broker::{Delivery, Inbound, Keeping, Message, Next, Outbox, Ticket};
use crate::config::{BrokerConfig, Tls};
use crate::run::{Input, network_thread};
use rumqttc::tokio_rustls::rustls::crypto::ring::default_provider;
use rumqttc::tokio_rustls::rustls::pki_types::pem::PemObject;
use rumqttc::tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rumqttc::tokio_rustls::rustls::{ClientConfig, RootCertStore};
use rumqttc::{
    AckMode, AsyncClient, ConnectionError, Event, EventLoop, LastWill, ManualAck, MqttOptions, Packet,
    PersistedAckMode, PersistedSession, PubAck, Publish, PublishOptions, QoS, SessionMode, SessionStore,
    SessionStoreError, SessionStoreKey, SubscribeFilter, SubscribeReasonCode, TlsConfiguration, Transport,
};
use std::future::ready;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// A larger message is not looked at: a second of samples of one cylinder has a hundredth of it.
pub const LARGEST_PAYLOAD: usize = 1024 * 1024;
/// The largest packet of MQTT: refused, it would come again for ever.
const LARGEST_PACKET: u32 = 268_435_460;
/// Requests between our tasks and the connection, and in one writing to the network.
const REQUESTS: usize = 64;
/// Packets that are read before the first of them is handed over.
const READS: usize = 16;
/// Between attempts to connect.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LONGEST_PAUSE: Duration = Duration::from_secs(15);
/// Until an alarm that the broker did not take is sent again.
const AGAIN: Duration = Duration::from_secs(1);
/// Between attempts to hand something to a queue that is full.
const BEAT: Duration = Duration::from_millis(1);

/// Connects, and again whenever the connection is lost, until the outbox is closed and empty, and then tells that it has
/// ended; what comes goes to `inbox`. `gone` is what the broker says of us when we are.
pub fn connect(
    config: &BrokerConfig,
    filters: Vec<String>,
    gone: Message,
    outbox: Arc<Outbox>,
    inbox: SyncSender<Input>,
) -> Result<Receiver<()>, Failure> {
    let options = options(config, gone)?;
    let (end, ended) = sync_channel(1);
    let run = async move || {
        let (client, connection) = AsyncClient::builder(options).capacity(REQUESTS).build();
        let shared = Arc::new(Shared::default());
        tokio::spawn(subscribe(client.clone(), filters, Arc::clone(&shared)));
        tokio::spawn(send(client, outbox, Arc::clone(&shared), inbox.clone()));
        listen(connection, &shared, &inbox).await;
        let _ = end.send(());
    };
    network_thread("mqtt", run)?;
    Ok(ended)
}

/// The way to the broker, and what is agreed with it.
fn options(config: &BrokerConfig, gone: Message) -> Result<MqttOptions, Failure> {
    let mut options = MqttOptions::new(&config.client_id, (config.host.as_str(), config.port));
    if let Some(login) = &config.login {
        options.set_credentials(&login.user, login.password.clone());
    }
    if let Some(tls) = &config.tls {
        let client = client(tls).map_err(|error| Failure::Tls(error.to_string()))?;
        options.set_transport(Transport::tls_with_config(TlsConfiguration::Rustls(Arc::new(client))));
    }
    let mut network = options.network_options();
    network.set_tcp_nodelay(true);
    options
        .set_network_options(network)
        .set_keep_alive(config.keep_alive_s)
        .set_session_mode(SessionMode::Persistent)
        .set_session_store(EmptySession)
        .set_outgoing_inflight_upper_limit(OUTGOING)
        // The broker sends so many before it waits for us.
        .set_receive_maximum(Some(config.in_flight.unwrap_or(u16::MAX)))
        .set_ack_mode(AckMode::Manual)
        .set_max_request_batch(REQUESTS)
        .set_read_batch_size(READS)
        .set_max_packet_size(Some(LARGEST_PACKET))
        .set_last_will(LastWill::new(gone.topic, gone.payload, QoS::AtLeastOnce, true, None));
    Ok(options)
}

/// Whom it trusts, and who it says it is.
fn client(tls: &Tls) -> Result<ClientConfig, Box<dyn std::error::Error>> {
    let mut roots = RootCertStore::empty();
    match &tls.authority {
        Some(pem) => {
            for certificate in CertificateDer::pem_slice_iter(pem) {
                roots.add(certificate?)?;
            }
        }
        None => _ = roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs),
    }
    let builder = ClientConfig::builder_with_provider(Arc::new(default_provider()));
    let builder = builder.with_safe_default_protocol_versions()?.with_root_certificates(roots);
    let Some(identity) = &tls.identity else { return Ok(builder.with_no_client_auth()) };
    let key = PrivateKeyDer::from_pem_slice(&identity.key)?;
    let chain = CertificateDer::pem_slice_iter(&identity.certificate).collect::<Result<_, _>>()?;
    Ok(builder.with_client_auth_cert(chain, key)?)
}

/// Between the tasks of the network thread.
#[derive(Default)]
struct Shared {
    /// Counts connections: what belongs to one that is gone is not sent over the next.
    connection: AtomicU64,
    up: Notify,
}

/// Polls the connection, and does nothing else.
async fn listen(mut connection: EventLoop, shared: &Shared, inbox: &SyncSender<Input>) {
    let (mut pause, mut session_kept) = (FIRST_PAUSE, false);
    loop {
        let inbound = match connection.poll().await {
            Ok(Event::Incoming(Packet::ConnAck(ack))) => {
                (pause, session_kept) = (FIRST_PAUSE, ack.session_present);
                shared.up.notify_one();
                continue;
            }
            Ok(Event::Incoming(Packet::Publish(publish))) => {
                Inbound::Delivery(delivery(&publish, shared.connection.load(Ordering::Relaxed)))
            }
            Ok(Event::Incoming(Packet::SubAck(ack)))
                if !ack.return_codes.iter().all(|code| matches!(code, SubscribeReasonCode::Success(_))) =>
            {
                Inbound::Down("the broker refuses a subscription".to_owned())
            }
            Ok(Event::Incoming(Packet::SubAck(_))) => Inbound::Up { session_kept },
            Ok(_) => continue,
            Err(ConnectionError::RequestsDone) => return,
            Err(error) => {
                shared.connection.fetch_add(1, Ordering::Relaxed);
                hand_over(inbox, Inbound::Down(error.to_string())).await;
                tokio::time::sleep(pause).await;
                pause = (2 * pause).min(LONGEST_PAUSE);
                continue;
            }
        };
        hand_over(inbox, inbound).await;
    }
}

fn delivery(publish: &Publish, connection: u64) -> Delivery {
    let size = publish.payload.len();
    Delivery {
        topic: String::from_utf8_lossy(&publish.topic).into_owned(),
        payload: if size <= LARGEST_PAYLOAD { Ok(publish.payload.to_vec()) } else { Err(size) },
        resent: publish.dup,
        ticket: (publish.qos == QoS::AtLeastOnce).then_some(Ticket { connection, id: publish.pkid }),
        received: Instant::now(),
    }
}

/// Gives the service what came; while it is behind, the thread goes on with other things.
async fn hand_over(inbox: &SyncSender<Input>, inbound: Inbound) {
    let mut input = Input::Broker(inbound);
    while let Err(TrySendError::Full(back)) = inbox.try_send(input) {
        input = back;
        tokio::time::sleep(BEAT).await;
    }
}

/// Subscribes anew with every connection: a broker may have lost the session.
async fn subscribe(client: AsyncClient, filters: Vec<String>, shared: Arc<Shared>) {
    loop {
        shared.up.notified().await;
        let filters = filters.iter().map(|filter| SubscribeFilter::new(filter.clone(), QoS::AtLeastOnce));
        if client.subscribe_many(filters).await.is_err() {
            return;
        }
    }
}

/// Empties the outbox into the connection.
async fn send(client: AsyncClient, outbox: Arc<Outbox>, shared: Arc<Shared>, inbox: SyncSender<Input>) {
    loop {
        match outbox.next().await {
            Next::Acknowledge(ticket) => {
                if ticket.connection != shared.connection.load(Ordering::Relaxed) {
                    continue;
                }
                let ack = ManualAck::PubAck(PubAck::new(ticket.id, None));
                if client.try_manual_ack(ack).is_err() {
                    outbox.put_back(Next::Acknowledge(ticket));
                    tokio::time::sleep(BEAT).await;
                }
            }
            Next::Publish(message) => publish(&client, &outbox, message, &inbox).await,
            Next::Close => {
                let _ = client.disconnect_with_timeout(Duration::from_secs(2)).await;
                return;
            }
        }
    }
}

async fn publish(client: &AsyncClient, outbox: &Arc<Outbox>, message: Message, inbox: &SyncSender<Input>) {
    let options = PublishOptions::at_least_once();
    let Keeping::Each(number) = message.keeping else {
        let options = options.retain(message.keeping == Keeping::Latest);
        let _ = client.publish(message.topic, message.payload, options).await;
        return;
    };
    let (topic, payload) = (message.topic.clone(), message.payload.clone());
    let Ok(notice) = client.publish_tracked(topic, payload, options).await else { return };
    let (outbox, inbox) = (Arc::clone(outbox), inbox.clone());
    tokio::spawn(async move {
        match notice.wait_completion_async().await {
            Ok(_) => hand_over(&inbox, Inbound::Confirmed(number)).await,
            Err(_) => {
                tokio::time::sleep(AGAIN).await;
                outbox.put_back(Next::Publish(message));
            }
        }
    });
}

type Answer<'a, T> = Pin<Box<dyn Future<Output = Result<T, SessionStoreError>> + Send + 'a>>;

/// Messages of ours that the broker may leave unacknowledged.
const OUTGOING: u16 = 1000;

/// What the crate asks for before it goes on with a session that the broker has kept: ours holds nothing. What we have sent and
/// the broker has not acknowledged is in `alarms.json`, and what it has sent and we have not acknowledged comes again.
#[derive(Debug)]
struct EmptySession;

impl SessionStore for EmptySession {
    fn load<'a>(&'a self, key: &'a SessionStoreKey) -> Answer<'a, Option<PersistedSession>> {
        let session = PersistedSession {
            format_version: 1,
            client_id: key.client_id().to_owned(),
            clean_start: false,
            session_expiry_interval: Some(u32::MAX),
            outgoing_inflight_upper_limit: Some(OUTGOING),
            ack_mode: PersistedAckMode::Manual,
            last_pkid: 0,
            last_puback: 0,
            replay: Vec::new(),
            incoming_qos2: Vec::new(),
        };
        Box::pin(ready(Ok(Some(session))))
    }

    fn save<'a>(&'a self, _: &'a SessionStoreKey, _: &'a PersistedSession) -> Answer<'a, ()> {
        Box::pin(ready(Ok(())))
    }

    fn clear<'a>(&'a self, _: &'a SessionStoreKey) -> Answer<'a, ()> {
        Box::pin(ready(Ok(())))
    }
}
