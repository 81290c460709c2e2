//! What MQTT 3.1.1 has no word for: how many messages the broker keeps for a client that is away, and how many it sends
//! before it waits for acknowledgements. Found out with empty messages for a client of our own that goes away.

use rumqttc::{
    AckMode, AsyncClient, ConnectionError, Event, EventLoop, MqttOptions, Packet, Publish, PublishOptions,
    QoS,
};
use std::time::Duration;

/// A broker that has more to say does so sooner.
const SILENCE: Duration = Duration::from_secs(1);
/// Messages given before their acknowledgements are waited for.
const AT_ONCE: usize = 100;
/// For all of it.
const PATIENCE: Duration = Duration::from_secs(120);

/// The broker's limits. Where it kept all that it was given, each may be larger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Messages that it was given.
    pub given: usize,
    /// Messages that it kept of them.
    pub kept: usize,
    /// Messages that it sent before it waited.
    pub in_flight: usize,
}

/// Two clients of the probe's own, and a topic between them.
pub struct Probe {
    /// How to reach the broker; the client's name is the receiver's.
    pub options: MqttOptions,
    pub topic: String,
    /// Messages to give.
    pub messages: usize,
}

impl Probe {
    /// Gives the broker messages, and counts those that come back.
    pub async fn limits(&self) -> Result<Limits, String> {
        let limits = tokio::time::timeout(PATIENCE, self.give_and_count()).await;
        let limits = limits.map_err(|_| format!("nothing known after {} s", PATIENCE.as_secs()))?;
        match limits {
            Ok(limits) if limits.kept == 0 => Err(format!("nothing comes back from topic `{}`", self.topic)),
            limits => limits.map_err(|error| error.to_string()),
        }
    }

    async fn give_and_count(&self) -> Result<Limits, ConnectionError> {
        self.forget().await?;
        let mut away = Visit::begin(self.receiver());
        let _ = away.client.subscribe(self.topic.clone(), QoS::AtLeastOnce).await;
        away.next(|packet| matches!(packet, Packet::SubAck(_)).then_some(())).await?;
        away.end().await?;
        self.give().await?;
        let limits = self.count().await?;
        self.forget().await?;
        Ok(limits)
    }

    /// Its session is kept while it is away.
    fn receiver(&self) -> MqttOptions {
        let mut options = self.options.clone();
        options.set_clean_session(false).set_ack_mode(AckMode::Manual);
        options
    }

    /// Nothing is kept after this, also of a probe that was killed.
    async fn forget(&self) -> Result<(), ConnectionError> {
        let mut visit = Visit::begin(self.options.clone());
        visit.next(|packet| matches!(packet, Packet::ConnAck(_)).then_some(())).await?;
        visit.end().await
    }

    async fn give(&self) -> Result<(), ConnectionError> {
        let mut options = self.options.clone();
        options.set_client_id(format!("{}-sender", options.client_id()));
        let mut visit = Visit::begin(options);
        let mut left = self.messages;
        while left > 0 {
            let some = left.min(AT_ONCE);
            for _ in 0..some {
                let empty = visit.client.publish(self.topic.clone(), "", PublishOptions::at_least_once());
                let _ = empty.await;
            }
            for _ in 0..some {
                visit.next(|packet| matches!(packet, Packet::PubAck(_)).then_some(())).await?;
            }
            left -= some;
        }
        visit.end().await
    }

    async fn count(&self) -> Result<Limits, ConnectionError> {
        let mut visit = Visit::begin(self.receiver());
        let mut unacknowledged = Vec::new();
        while unacknowledged.len() < self.messages
            && let Some(publish) = visit.delivery().await?
        {
            unacknowledged.push(publish);
        }
        let in_flight = unacknowledged.len();
        let mut kept = in_flight;
        while kept < self.messages {
            for publish in unacknowledged.drain(..) {
                let _ = visit.client.ack(&publish).await;
            }
            let Some(publish) = visit.delivery().await? else { break };
            unacknowledged.push(publish);
            kept += 1;
        }
        visit.end().await?;
        Ok(Limits { given: self.messages, kept, in_flight })
    }
}

/// One connection from its begin to its end.
struct Visit {
    client: AsyncClient,
    connection: EventLoop,
}

impl Visit {
    fn begin(options: MqttOptions) -> Self {
        // Requests are never more than what the broker sends before it waits.
        let (client, connection) = AsyncClient::builder(options).unbounded().build();
        Self { client, connection }
    }

    /// The next packet of a kind.
    async fn next<T>(&mut self, of: impl Fn(Packet) -> Option<T>) -> Result<T, ConnectionError> {
        loop {
            if let Event::Incoming(packet) = self.connection.poll().await?
                && let Some(found) = of(packet)
            {
                return Ok(found);
            }
        }
    }

    /// The next message; none after a silence.
    async fn delivery(&mut self) -> Result<Option<Publish>, ConnectionError> {
        let next = self.next(|packet| match packet {
            Packet::Publish(publish) => Some(publish),
            _ => None,
        });
        tokio::time::timeout(SILENCE, next).await.ok().transpose()
    }

    async fn end(mut self) -> Result<(), ConnectionError> {
        let _ = self.client.disconnect_with_timeout(SILENCE).await;
        loop {
            match self.connection.poll().await {
                Ok(_) => {}
                Err(ConnectionError::RequestsDone) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
    }
}
