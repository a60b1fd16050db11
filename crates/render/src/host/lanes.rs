//! Numbers of a packet's rays, one lane per ray.

/// Rays per packet.
pub(super) const RAYS: usize = 32;
/// One number per ray.
pub(super) type Lanes = [f32; RAYS];
/// One whole number per ray.
pub(super) type Words = [u32; RAYS];

/// Reduces all lanes to one number, half by half as vector registers do.
#[inline(always)]
pub(super) fn fold(mut of: Lanes, pick: fn(f32, f32) -> f32) -> f32 {
    let mut half = RAYS / 2;
    while half > 0 {
        for i in 0..half {
            of[i] = pick(of[i], of[i + half]);
        }
        half /= 2;
    }
    of[0]
}

/// Indices of the set bits, which stand for lanes.
#[inline(always)]
pub(super) fn bits(mut of: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (of != 0).then(|| (of.trailing_zeros() % RAYS as u32) as usize)?;
        of &= of - 1;
        Some(lane)
    })
}
