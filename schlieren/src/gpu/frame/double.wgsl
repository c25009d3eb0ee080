// Numbers of 48 bits as unevaluated sums of two f32, high part first (Dekker 1971; Knuth's two-sum).
// The host prepares rays in f64; devices need not have that type. `rounded` of march.wgsl keeps
// compilers from simplifying the errors of rounding away.

// a + b and its error.
fn two_sum(a: f32, b: f32) -> vec2f {
    let s = rounded(a + b);
    let t = rounded(s - a);
    return vec2f(s, (a - rounded(s - t)) + (b - t));
}

// a b and its error. The halves have 12 bits, so that their products are exact. fma() would do,
// but WGSL allows it to round twice.
fn two_product(a: f32, b: f32) -> vec2f {
    let p = rounded(a * b);
    let ah = bitcast<f32>(bitcast<u32>(a) & 0xfffff000u);
    let bh = bitcast<f32>(bitcast<u32>(b) & 0xfffff000u);
    let al = rounded(a - ah);
    let bl = rounded(b - bh);
    let e = rounded(ah * bh) - p;
    return vec2f(p, (rounded(e + rounded(ah * bl)) + rounded(al * bh)) + al * bl);
}

// The same number with the larger part first.
fn normal(a: vec2f) -> vec2f {
    let s = rounded(a.x + a.y);
    return vec2f(s, a.y - rounded(s - a.x));
}

fn sum(a: vec2f, b: vec2f) -> vec2f {
    let high = two_sum(a.x, b.x);
    let low = two_sum(a.y, b.y);
    let with_carry = normal(vec2f(high.x, high.y + low.x));
    return normal(vec2f(with_carry.x, with_carry.y + low.y));
}

fn product(a: vec2f, b: vec2f) -> vec2f {
    let p = two_product(a.x, b.x);
    return normal(vec2f(p.x, p.y + (a.x * b.y + a.y * b.x)));
}

fn times(a: vec2f, b: f32) -> vec2f {
    let p = two_product(a.x, b);
    return normal(vec2f(p.x, p.y + a.y * b));
}

// By long division: three digits of a quotient.
fn quotient(a: vec2f, b: vec2f) -> vec2f {
    let first = rounded(a.x / b.x);
    let rest = sum(a, -times(b, first));
    let second = rounded(rest.x / b.x);
    let last = sum(rest, -times(b, second));
    return sum(two_sum(first, second), vec2f(last.x / b.x, 0.0));
}

// 1 / sqrt(a): a step of Newton's method from the device's approximation.
fn inverse_root(a: vec2f) -> vec2f {
    let y = inverseSqrt(a.x);
    let rest = sum(vec2f(1.0, 0.0), -product(a, two_product(y, y)));
    return two_sum(y, 0.5 * y * rest.x);
}

fn root(a: vec2f) -> vec2f {
    let y = inverseSqrt(a.x);
    let s = rounded(a.x * y);
    let rest = sum(a, -two_product(s, s));
    return two_sum(s, 0.5 * y * rest.x);
}

fn less(a: vec2f, b: vec2f) -> bool {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
}

fn smaller(a: vec2f, b: vec2f) -> vec2f {
    if less(b, a) {
        return b;
    }
    return a;
}

fn larger(a: vec2f, b: vec2f) -> vec2f {
    if less(a, b) {
        return b;
    }
    return a;
}

// The smallest whole number that is not below a.
fn whole_from(a: vec2f) -> f32 {
    let whole = ceil(a.x);
    if whole == a.x && a.y > 0.0 {
        return whole + 1.0;
    }
    return whole;
}

// The largest whole number that is not above a.
fn whole_to(a: vec2f) -> f32 {
    return -whole_from(-a);
}
