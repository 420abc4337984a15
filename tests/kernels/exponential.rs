use crate::bench::{passes, subject};
use nerf::check::exponential::exponentials;

#[test]
fn exponentials_agree_with_the_reference() {
    passes([exponentials(&subject()).expect("runs")]);
}
