//! Cosines and sines of joints, several at a time.

use crate::scalar::Real;

/// Calls a body with four joints at a time, then with the rest; or one by one if that costs less.
macro_rules! in_fours {
    ($T:ty, $joints:expr, |$some:ident| $body:block) => {
        if !<$T>::TOGETHER {
            for joint in $joints { let $some = [*joint]; $body }
            return;
        }
        let (fours, rest) = $joints.as_chunks::<4>();
        for $some in fours.iter().copied() $body
        match *rest {
            [a] => { let $some = [a]; $body }
            [a, b] => { let $some = [a, b]; $body }
            [a, b, c] => { let $some = [a, b, c]; $body }
            _ => {}
        }
    };
}

/// The cosine and sine of each of these joints, given as indices of (cosine, sine) and of the
/// coordinate.
#[inline]
pub(crate) fn turn<T: Real>(joints: &[(usize, usize)], q: &[T], cos_sin: &mut [(T, T)]) {
    in_fours!(T, joints, |some| {
        let found = T::sin_cos_of(some.map(|(_, q_at)| q[q_at]));
        for ((at, _), (s, c)) in some.into_iter().zip(found) {
            cos_sin[at] = (c, s);
        }
    });
}

/// Cosines and sines of joints in no list.
#[inline]
pub(crate) fn turn_some<T: Real>(
    joints: impl Iterator<Item = (usize, usize)>,
    q: &[T],
    cos_sin: &mut [(T, T)],
) {
    if !T::TOGETHER {
        joints.for_each(|joint| turn(&[joint], q, cos_sin));
        return;
    }
    let mut some = [(0, 0); 4];
    let mut count = 0;
    for joint in joints {
        some[count % 4] = joint;
        count += 1;
        if count % 4 == 0 {
            turn(&some, q, cos_sin);
        }
    }
    turn(&some[..count % 4], q, cos_sin);
}

/// The coordinate of each of these joints from its cosine and sine.
#[inline]
pub(crate) fn read_turns<T: Real>(joints: &[(usize, usize)], cos_sin: &[(T, T)], q: &mut [T]) {
    in_fours!(T, joints, |some| {
        let found = T::angles_of(some.map(|(at, _)| cos_sin[at]));
        for ((_, q_at), angle) in some.into_iter().zip(found) {
            q[q_at] = angle;
        }
    });
}
