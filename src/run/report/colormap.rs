//! Colour maps: equally bright steps for equal steps of a number (Smith and van der Walt, 2015).

/// Colours at equal steps from 0 to 1.
pub(super) type Colormap = [[u8; 3]; 9];

/// From black over red to pale yellow.
pub(super) const INFERNO: Colormap = [
    [0x00, 0x00, 0x04],
    [0x1f, 0x0c, 0x48],
    [0x55, 0x0f, 0x6d],
    [0x88, 0x22, 0x6a],
    [0xba, 0x36, 0x55],
    [0xe3, 0x59, 0x33],
    [0xf9, 0x8c, 0x0a],
    [0xf9, 0xc9, 0x32],
    [0xfc, 0xff, 0xa4],
];

/// From dark violet over green to yellow.
pub(super) const VIRIDIS: Colormap = [
    [0x44, 0x01, 0x54],
    [0x47, 0x2d, 0x7b],
    [0x3b, 0x52, 0x8b],
    [0x2c, 0x72, 0x8e],
    [0x21, 0x91, 0x8c],
    [0x28, 0xae, 0x80],
    [0x5e, 0xc9, 0x62],
    [0xad, 0xdc, 0x30],
    [0xfd, 0xe7, 0x25],
];

/// The colour of `part` in `[0, 1]` of the map; what is not a number gets the last.
pub(super) fn color(map: &Colormap, part: f32) -> [u8; 3] {
    let part = if part.is_nan() { 1.0 } else { part.clamp(0.0, 1.0) };
    let place = part * (map.len() - 1) as f32;
    let below = (place as usize).min(map.len() - 2);
    let (a, b, t) = (map[below], map[below + 1], place - below as f32);
    std::array::from_fn(|i| (f32::from(a[i]) * (1.0 - t) + f32::from(b[i]) * t + 0.5) as u8)
}

/// The map from left to right, as the value of a CSS `background`.
pub(super) fn gradient(map: &Colormap) -> String {
    let colors = map.map(|[r, g, b]| format!("#{r:02x}{g:02x}{b:02x}")).join(", ");
    format!("linear-gradient(to right, {colors})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_between_the_steps_are_mixed() {
        let heat = |part| color(&INFERNO, part);
        assert_eq!(
            (heat(0.0), heat(1.0), heat(9.0), heat(-1.0)),
            (INFERNO[0], INFERNO[8], INFERNO[8], INFERNO[0])
        );
        assert_eq!((heat(0.5), heat(f32::NAN)), (INFERNO[4], INFERNO[8]));
        assert_eq!(heat(1.0 / 16.0), [0x10, 0x06, 0x26]);
        assert_eq!(gradient(&VIRIDIS).matches('#').count(), VIRIDIS.len());
    }
}
