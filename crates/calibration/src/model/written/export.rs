//! An effect of the library as text, written by the effect itself: its Rust runs once on a scalar that keeps the
//! expression instead of a number. Where the Rust branches both branches are taken, and the text has an `if_positive`.

use std::cell::RefCell;
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};
use std::ops::{Add, Div, Mul, Neg, Sub};

use cvg_model::effects::{EffectId, MAX_PARAMETERS, Moment, Role, Stage};
use cvg_model::resonator::envelope::precession;
use cvg_model::{AxisForces, Envelope, Real};

use super::{EffectText, ParameterText, language, stage_name};
use crate::error::Refusal;

/// The most ways through an effect.
const MOST_PATHS: usize = 64;

/// Writes an effect of the library as an effect file would have it. Its name is the library's: it has to get another one
/// before it can compete.
///
/// # Errors
/// Where the effect cannot be written as a map.
pub fn export(id: EffectId) -> Result<EffectText, Refusal> {
    let d = id.description();
    let refuse = |why: &str| Err(Refusal::new(d.id, why, "an effect that is a map of bounded length"));
    if let EffectId::WrittenFirst(written) | EffectId::Written(written) = id {
        return EffectText::parse(written.text, d.source);
    }
    SHEET.with_borrow_mut(|sheet| *sheet = Sheet::default());
    name_what_has_a_name();
    let turned = explored(&|| run(id).as_deref().and_then(as_a_turn), &mut Vec::new(), &mut 0);
    let Some(outputs) = turned.or_else(|| explored(&|| run(id), &mut Vec::new(), &mut 0)) else {
        return refuse("it has too many branches");
    };
    let mut map = BTreeMap::new();
    for (name, own, value) in outputs {
        if own.is_none_or(|own| own != value) && !(own.is_none() && value == Symbol::ratio(0, 1)) {
            let Some(text) = written(value) else { return refuse("its expressions are too long") };
            map.insert(name.to_owned(), text);
        }
    }
    let parameter = d
        .parameters
        .iter()
        .map(|p| ParameterText {
            name: p.name.into(),
            unit: p.unit.into(),
            neutral: p.neutral,
            scale: p.scale,
            lower: Some(p.lower),
            upper: Some(p.upper),
            held: matches!(p.role, Role::Searched(_) | Role::Located(_) | Role::Chosen(_)),
        })
        .collect();
    let stage = stage_name(d.stage).to_owned();
    let text = EffectText {
        id: d.id.into(),
        summary: d.title.into(),
        stage,
        first: id.acts_on_angle(),
        onsets: d.onsets.to_vec(),
        parameter,
        map,
        law: None,
    };
    match text.compiled() {
        Ok(_) => Ok(text),
        Err(problem) => refuse(&problem),
    }
}

/// Name of an output, what it is without the effect, and what it is with it.
type Output = (&'static str, Option<Symbol>, Symbol);
type Outputs = Vec<Output>;

/// The outputs over all branches that begin with `taken`; None where there are too many.
fn explored(run: &dyn Fn() -> Option<Outputs>, taken: &mut Vec<bool>, paths: &mut usize) -> Option<Outputs> {
    *paths += 1;
    if *paths > MOST_PATHS {
        return None;
    }
    SHEET.with_borrow_mut(|sheet| (sheet.taken, sheet.asked) = (taken.clone(), Vec::new()));
    let outputs = run()?;
    let condition = SHEET.with_borrow(|sheet| sheet.asked.get(taken.len()).copied());
    let Some(condition) = condition else { return Some(outputs) };
    taken.push(true);
    let one = explored(run, taken, paths)?;
    taken.pop();
    taken.push(false);
    let other = explored(run, taken, paths)?;
    taken.pop();
    let joined = |((name, own, a), (_, _, b)): ((_, _, Symbol), (_, _, Symbol))| {
        let value = if a == b { a } else { node(Node::IfPositive(condition, a, b)) };
        (name, own, value)
    };
    Some(one.into_iter().zip(other).map(joined).collect())
}

fn named(name: &'static str) -> Symbol {
    node(Node::Name(name))
}

fn vibration() -> Envelope<Symbol> {
    Envelope::new(named("x_c"), named("x_s"), named("y_c"), named("y_s"))
}

/// Pendulum variables and the direction of a vibration go by their names.
fn name_what_has_a_name() {
    let e = vibration();
    let p = e.pendulum();
    let names = [("E", p.e), ("Q", p.q), ("R", p.r), ("S", p.s), ("theta", e.y_c.atan2(e.x_c))];
    SHEET.with_borrow_mut(|sheet| sheet.names = names.into_iter().map(|(name, symbol)| (symbol, name)).collect());
}

/// Outputs that turn the vibration, as its angle or as the rate of that.
fn as_a_turn(outputs: &[Output]) -> Option<Outputs> {
    let e = vibration();
    let value = |name: &str| outputs.iter().find(|(n, ..)| *n == name).map(|(.., value)| *value);
    let are = |turned: Envelope<Symbol>| {
        [turned.x_c, turned.x_s, turned.y_c, turned.y_s].iter().zip(outputs).all(|(a, (.., b))| a == b)
    };
    if let Some(rate) = value("y_c_rate") {
        let zero = Symbol::ratio(0, 1);
        let rate = match rate.node() {
            Node::Product(rate, _) => rate,
            _ => zero,
        };
        let turns = if rate == zero { are(Envelope::zero()) } else { are(precession(rate, &e)) };
        return turns.then(|| vec![("theta_rate", None, rate)]);
    }
    let theta = e.y_c.atan2(e.x_c);
    if are(e) {
        return Some(vec![("theta'", Some(theta), theta)]);
    }
    let (Node::Sum(a, _) | Node::Difference(a, _)) = value("x_c'")?.node() else { return None };
    let Node::Product(cosine, _) = a.node() else { return None };
    let Node::Cosine(angle) = cosine.node() else { return None };
    let (sin, cos) = angle.sin_cos();
    let turned = [(sin, theta + angle), (-sin, theta - angle)].into_iter().find(|(sin, _)| are(e.turned(*sin, cos)))?;
    Some(vec![("theta'", Some(theta), turned.1)])
}

/// One run of the effect's own Rust.
fn run(id: EffectId) -> Option<Outputs> {
    let d = id.description();
    let zero = Symbol::ratio(0, 1);
    let p: [Symbol; MAX_PARAMETERS] = std::array::from_fn(|i| d.parameters.get(i).map_or(zero, |p| named(p.name)));
    let drive = AxisForces {
        x_c: named("drive_x_c"),
        x_s: named("drive_x_s"),
        y_c: named("drive_y_c"),
        y_s: named("drive_y_s"),
    };
    let at = Moment {
        t_s: named("t"),
        table_rad: named("table"),
        precession_rad_s: named("precession"),
        warmer_k: named("warmer"),
        drive,
    };
    let e = vibration();
    let own = [e.x_c, e.x_s, e.y_c, e.y_s];
    let four = |names: [&'static str; 4], own: [Option<Symbol>; 4], out: [Symbol; 4]| -> Outputs {
        (0..4).map(|i| (names[i], own[i], out[i])).collect()
    };
    let primed = ["x_c'", "x_s'", "y_c'", "y_s'"];
    Some(match d.stage {
        Stage::Input => {
            let rate = named("rate");
            vec![("rate'", Some(rate), id.input_rate(&p, rate, &at))]
        }
        Stage::Mechanics => {
            let z = id.mechanics(&p, &e, &at);
            four(["x_c_rate", "x_s_rate", "y_c_rate", "y_s_rate"], [None; 4], [z.x_c, z.x_s, z.y_c, z.y_s])
        }
        Stage::Actuation => {
            let f = id.actuate(&p, AxisForces { x_c: e.x_c, x_s: e.x_s, y_c: e.y_c, y_s: e.y_s }, &at);
            four(primed, own.map(Some), [f.x_c, f.x_s, f.y_c, f.y_s])
        }
        Stage::Readout => {
            let z = id.read(&p, e, &at);
            four(primed, own.map(Some), [z.x_c, z.x_s, z.y_c, z.y_s])
        }
    })
}

/// A number that was not calculated but noted down: its place on the sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Symbol(usize);

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Node {
    Ratio(i64, i64),
    Pi,
    Name(&'static str),
    Negative(Symbol),
    Sum(Symbol, Symbol),
    Difference(Symbol, Symbol),
    Product(Symbol, Symbol),
    Quotient(Symbol, Symbol),
    Power(Symbol, u8),
    SquareRoot(Symbol),
    Sine(Symbol),
    Cosine(Symbol),
    Arctangent2(Symbol, Symbol),
    IfPositive(Symbol, Symbol, Symbol),
}

/// Everything noted down, and which branches are taken.
#[derive(Default)]
struct Sheet {
    nodes: Vec<Node>,
    places: HashMap<Node, Symbol>,
    taken: Vec<bool>,
    asked: Vec<Symbol>,
    /// expressions that the language has a name for
    names: HashMap<Symbol, &'static str>,
}

thread_local! {
    static SHEET: RefCell<Sheet> = RefCell::default();
}

fn node(node: Node) -> Symbol {
    SHEET.with_borrow_mut(|sheet| {
        *sheet.places.entry(node).or_insert_with(|| {
            sheet.nodes.push(node);
            Symbol(sheet.nodes.len() - 1)
        })
    })
}

impl Symbol {
    fn node(self) -> Node {
        SHEET.with_borrow(|sheet| sheet.nodes[self.0])
    }

    fn constant(self) -> Option<(i64, i64)> {
        match self.node() {
            Node::Ratio(n, d) => Some((n, d)),
            _ => None,
        }
    }

    fn is(self, value: i64) -> bool {
        self.constant() == Some((value, 1))
    }

    /// Whether it is above 0: on this path, or known.
    fn is_positive(self) -> bool {
        if let Some((n, _)) = self.constant() {
            return n > 0;
        }
        SHEET.with_borrow_mut(|sheet| {
            if let Some(at) = sheet.asked.iter().position(|asked| *asked == self) {
                return sheet.taken.get(at).copied().unwrap_or(true);
            }
            sheet.asked.push(self);
            sheet.taken.get(sheet.asked.len() - 1).copied().unwrap_or(true)
        })
    }
}

/// A ratio in lowest terms; none where it does not fit.
fn reduced(n: Option<i64>, d: Option<i64>) -> Option<Symbol> {
    let (n, d) = (n?, d?);
    let (mut a, mut b) = (n.unsigned_abs(), d.unsigned_abs());
    while b != 0 {
        (a, b) = (b, a % b);
    }
    let by = i64::try_from(a).ok().filter(|by| *by != 0 && d != 0)? * d.signum();
    Some(node(Node::Ratio(n / by, d / by)))
}

impl PartialOrd for Symbol {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(if *self > *other {
            Ordering::Greater
        } else if *self < *other {
            Ordering::Less
        } else {
            Ordering::Equal
        })
    }
    fn lt(&self, other: &Self) -> bool {
        (*other - *self).is_positive()
    }
    fn gt(&self, other: &Self) -> bool {
        (*self - *other).is_positive()
    }
    fn le(&self, other: &Self) -> bool {
        !self.gt(other)
    }
    fn ge(&self, other: &Self) -> bool {
        !self.lt(other)
    }
}

impl Add for Symbol {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        if let Some(((a, b), (c, d))) = self.constant().zip(o.constant())
            && let Some(sum) =
                reduced(a.checked_mul(d).zip(c.checked_mul(b)).and_then(|(x, y)| x.checked_add(y)), b.checked_mul(d))
        {
            return sum;
        }
        match (self.is(0), o.is(0), o.node()) {
            (true, ..) => o,
            (_, true, _) => self,
            (.., Node::Negative(o)) => self - o,
            _ => node(Node::Sum(self, o)),
        }
    }
}

impl Sub for Symbol {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        if self.constant().is_some() && o.constant().is_some() {
            return self + -o;
        }
        match (self.is(0), o.is(0), o.node()) {
            (true, ..) => -o,
            (_, true, _) => self,
            (.., Node::Negative(o)) => self + o,
            _ => node(Node::Difference(self, o)),
        }
    }
}

impl Mul for Symbol {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        if let Some(((a, b), (c, d))) = self.constant().zip(o.constant())
            && let Some(product) = reduced(a.checked_mul(c), b.checked_mul(d))
        {
            return product;
        }
        if self.is(0) || o.is(0) {
            return Self::ratio(0, 1);
        }
        match (self.node(), o.node()) {
            _ if self.is(1) => o,
            _ if o.is(1) => self,
            (Node::Negative(a), Node::Negative(b)) => a * b,
            (Node::Negative(a), _) => -(a * o),
            (_, Node::Negative(b)) => -(self * b),
            (Node::Power(a, n), _) if a == o && n < 8 => node(Node::Power(a, n + 1)),
            _ if self == o => node(Node::Power(self, 2)),
            _ => node(Node::Product(self, o)),
        }
    }
}

impl Div for Symbol {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        if let Some(((a, b), (c, d))) = self.constant().zip(o.constant())
            && let Some(quotient) = reduced(a.checked_mul(d), b.checked_mul(c))
        {
            return quotient;
        }
        if o.is(1) { self } else { node(Node::Quotient(self, o)) }
    }
}

impl Neg for Symbol {
    type Output = Self;
    fn neg(self) -> Self {
        match self.node() {
            Node::Ratio(n, d) => node(Node::Ratio(-n, d)),
            Node::Negative(a) => a,
            _ => node(Node::Negative(self)),
        }
    }
}

impl Real for Symbol {
    fn ratio(numerator: i32, denominator: i32) -> Self {
        let (n, d) = (i64::from(numerator), i64::from(denominator));
        reduced(Some(n), Some(d)).unwrap_or_else(|| node(Node::Ratio(n, d)))
    }
    fn sqrt(self) -> Self {
        if self.is(0) || self.is(1) { self } else { node(Node::SquareRoot(self)) }
    }
    fn sin_cos(self) -> (Self, Self) {
        if self.is(0) {
            return (self, Self::ratio(1, 1));
        }
        (node(Node::Sine(self)), node(Node::Cosine(self)))
    }
    fn atan2(self, x: Self) -> Self {
        if self.is(0) && x.is(-1) { node(Node::Pi) } else { node(Node::Arctangent2(self, x)) }
    }
}

/// Sums bind weakest, then products, then powers.
const SUM: u8 = 0;
const PRODUCT: u8 = 1;
const SIGN: u8 = 2;
const POWER: u8 = 3;
const WHOLE: u8 = 4;

/// The text of a number; none where it is too long.
fn written(symbol: Symbol) -> Option<String> {
    let mut text = String::new();
    write_down(symbol, SUM, &mut text).then_some(text)
}

fn write_down(symbol: Symbol, within: u8, out: &mut String) -> bool {
    if out.len() > language::MAX_TEXT {
        return false;
    }
    if let Some(name) = SHEET.with_borrow(|sheet| sheet.names.get(&symbol).copied()) {
        out.push_str(name);
        return true;
    }
    let node = symbol.node();
    let strength = match node {
        Node::Sum(..) | Node::Difference(..) => SUM,
        Node::Product(..) | Node::Quotient(..) => PRODUCT,
        Node::Ratio(_, d) if d != 1 => PRODUCT,
        Node::Ratio(n, _) if n < 0 => SIGN,
        Node::Negative(..) => SIGN,
        Node::Power(..) => POWER,
        _ => WHOLE,
    };
    let bracket = strength < within;
    if bracket {
        out.push('(');
    }
    let two = |out: &mut String, a, sign, b, left, right| {
        write_down(a, left, out) && {
            out.push_str(sign);
            write_down(b, right, out)
        }
    };
    let call = |out: &mut String, name: &str, operands: &[Symbol]| {
        out.push_str(name);
        operands.iter().enumerate().all(|(i, operand)| {
            out.push_str(if i == 0 { "(" } else { ", " });
            write_down(*operand, SUM, out)
        }) && {
            out.push(')');
            true
        }
    };
    let whole = match node {
        Node::Ratio(n, 1) => {
            out.push_str(&n.to_string());
            true
        }
        Node::Ratio(n, d) => {
            out.push_str(&format!("{n}/{d}"));
            true
        }
        Node::Pi => {
            out.push_str("pi");
            true
        }
        Node::Name(name) => {
            out.push_str(name);
            true
        }
        Node::Negative(a) => {
            out.push('-');
            write_down(a, POWER, out)
        }
        Node::Sum(a, b) => two(out, a, " + ", b, SUM, PRODUCT),
        Node::Difference(a, b) => two(out, a, " - ", b, SUM, PRODUCT),
        Node::Product(a, b) => two(out, a, " * ", b, PRODUCT, SIGN),
        Node::Quotient(a, b) => two(out, a, " / ", b, PRODUCT, SIGN),
        Node::Power(a, n) => {
            write_down(a, WHOLE, out) && {
                out.push_str(&format!("^{n}"));
                true
            }
        }
        Node::SquareRoot(a) => call(out, "sqrt", &[a]),
        Node::Sine(a) => call(out, "sin", &[a]),
        Node::Cosine(a) => call(out, "cos", &[a]),
        Node::Arctangent2(a, b) => call(out, "atan2", &[a, b]),
        Node::IfPositive(c, a, b) => call(out, "if_positive", &[c, a, b]),
    };
    if bracket {
        out.push(')');
    }
    whole && out.len() <= language::MAX_TEXT
}
