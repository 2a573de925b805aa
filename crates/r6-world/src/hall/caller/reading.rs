//! A caller that follows the values, and for a time reads nothing (G5).

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::{sleep, timeout};

use super::{Work, ms};
use crate::fault::Class;
use crate::hall::http::{connect, request};
use crate::hall::token_of;

impl Work {
    /// Follows the values of all robots.
    pub(super) async fn follow(&mut self) {
        while !self.is_over() {
            self.follow_once().await;
            self.rest(1000).await;
        }
    }

    async fn follow_once(&mut self) {
        let Ok(mut stream) = connect().await else { return };
        let head = request("GET", "/v1/live", &token_of(self.index), None);
        if stream.write_all(&head).await.is_err() {
            return;
        }
        let index = self.index;
        let mut buffer = vec![0; 4096];
        let until = ms(1000) + self.random.up_to(ms(2000));
        let mut total = 0;
        let reading = async {
            while let Ok(count @ 1..) = stream.read(&mut buffer).await {
                total += count;
            }
        };
        let _ = timeout(until, reading).await;
        self.shared
            .tell(format_args!("caller-{index}: followed {total} bytes, and reads nothing for a time"));
        let pause = ms(5000) + self.random.up_to(ms(9000));
        sleep(pause).await;
        // What waited in between, and then the end if the gateway has given it up.
        let rest = timeout(ms(1500), async {
            while let Ok(count @ 1..) = stream.read(&mut buffer).await {
                total += count;
            }
        });
        if rest.await.is_ok() {
            self.shared.state().record.strikes(Class::G5);
        }
        self.shared.tell(format_args!("caller-{index}: {total} bytes in all"));
    }
}
