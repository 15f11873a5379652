//! The language of the expressions: numbers, names, `+ - * / ^`, parentheses, functions. It has no loops, no definitions
//! and no way to a file; what it makes of a text is a list of steps that ends.

use cvg_model::effects::Stage;
use cvg_model::effects::written::{MAX_DEPTH, MAX_STEPS, Step, Target, Variable, is_sound};

/// The longest expression, bytes.
pub(crate) const MAX_TEXT: usize = 16_384;
/// How deep parentheses may be nested.
const MAX_NESTING: usize = 48;
/// The largest exponent.
const MAX_POWER: i8 = 16;

/// Functions: name, operands, whether a complex operand has a place there.
const FUNCTIONS: [(&str, usize, bool); 12] = [
    ("abs", 1, true),
    ("re", 1, true),
    ("im", 1, true),
    ("conj", 1, true),
    ("sqrt", 1, false),
    ("sin", 1, false),
    ("cos", 1, false),
    ("exp", 1, false),
    ("atan2", 2, false),
    ("min", 2, false),
    ("max", 2, false),
    ("if_positive", 3, true),
];

/// What goes by a name in every stage.
const CONSTANTS: [(&str, Step); 2] = [("i", Step::ImaginaryUnit), ("pi", Step::Pi)];

const ENVELOPE: [(&str, Variable); 11] = [
    ("x", Variable::X),
    ("y", Variable::Y),
    ("x_c", Variable::Xc),
    ("x_s", Variable::Xs),
    ("y_c", Variable::Yc),
    ("y_s", Variable::Ys),
    ("theta", Variable::Theta),
    ("E", Variable::E),
    ("Q", Variable::Q),
    ("R", Variable::R),
    ("S", Variable::S),
];
const WARMER: (&str, Variable) = ("warmer", Variable::Warmer);
const MOMENT: [(&str, Variable); 4] =
    [("t", Variable::Time), ("table", Variable::Table), ("precession", Variable::Precession), WARMER];
const DRIVE: [(&str, Variable); 6] = [
    ("drive_x", Variable::DriveX),
    ("drive_y", Variable::DriveY),
    ("drive_x_c", Variable::DriveXc),
    ("drive_x_s", Variable::DriveXs),
    ("drive_y_c", Variable::DriveYc),
    ("drive_y_s", Variable::DriveYs),
];
const RATE: [(&str, Variable); 1] = [("rate", Variable::Rate)];

/// What an effect of `stage` may ask for by name.
pub(crate) fn variables(stage: Stage) -> Vec<(&'static str, Variable)> {
    match stage {
        Stage::Input => [&RATE[..], &MOMENT[..]].concat(),
        Stage::Mechanics | Stage::Actuation => [&ENVELOPE[..], &[WARMER]].concat(),
        Stage::Readout => [&ENVELOPE[..], &MOMENT[..], &DRIVE[..]].concat(),
    }
}

/// What an effect of `stage` may give a value to: its name, what it is, and whether it takes a complex number.
pub(crate) fn targets(stage: Stage) -> &'static [(&'static str, Target, bool)] {
    match stage {
        Stage::Input => &[("rate'", Target::Rate, false)],
        Stage::Mechanics => &[
            ("theta_rate", Target::Theta, false),
            ("damping", Target::Damping, false),
            ("x_rate", Target::X, true),
            ("y_rate", Target::Y, true),
            ("x_c_rate", Target::Xc, false),
            ("x_s_rate", Target::Xs, false),
            ("y_c_rate", Target::Yc, false),
            ("y_s_rate", Target::Ys, false),
        ],
        Stage::Actuation | Stage::Readout => &[
            ("x'", Target::X, true),
            ("y'", Target::Y, true),
            ("x_c'", Target::Xc, false),
            ("x_s'", Target::Xs, false),
            ("y_c'", Target::Yc, false),
            ("y_s'", Target::Ys, false),
            ("theta'", Target::Theta, false),
        ],
    }
}

/// Whether a name is taken by the language itself.
pub(crate) fn is_reserved(name: &str) -> bool {
    let named = |list: &[(&str, Variable)]| list.iter().any(|(n, _)| *n == name);
    named(&ENVELOPE)
        || named(&MOMENT)
        || named(&DRIVE)
        || named(&RATE)
        || CONSTANTS.iter().any(|(n, _)| *n == name)
        || FUNCTIONS.iter().any(|(n, ..)| *n == name)
}

/// An expression in steps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Expression {
    pub(crate) steps: Vec<Step>,
    /// it has an imaginary part
    pub(crate) complex: bool,
}

/// What is wrong with an expression, and at which character from 1.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Problem {
    pub(crate) at: usize,
    pub(crate) what: String,
}

/// Reads an expression over the variables of `stage` and the parameters by name.
///
/// # Errors
/// What is wrong, and where. Every text gets an answer, in time in proportion to its length.
pub(crate) fn parse(text: &str, stage: Stage, parameters: &[&str]) -> Result<Expression, Problem> {
    if text.len() > MAX_TEXT {
        return Err(Problem { at: 1, what: format!("longer than {MAX_TEXT} bytes") });
    }
    let mut parser = Parser {
        characters: text.chars().collect(),
        at: 0,
        nesting: 0,
        steps: Vec::new(),
        variables: variables(stage),
        parameters,
    };
    let complex = parser.sum()?;
    if let Some(sign) = parser.peek() {
        return parser.refuse(format!("`{sign}` is not expected here"));
    }
    if parser.steps.len() > MAX_STEPS {
        return parser.refuse(format!("more than {MAX_STEPS} steps"));
    }
    if !is_sound(&parser.steps, parameters.len()) {
        return parser
            .refuse(format!("it needs more than {MAX_DEPTH} numbers at once: fewer nested operands on the right"));
    }
    Ok(Expression { steps: parser.steps, complex })
}

struct Parser<'a> {
    characters: Vec<char>,
    at: usize,
    nesting: usize,
    steps: Vec<Step>,
    variables: Vec<(&'static str, Variable)>,
    parameters: &'a [&'a str],
}

/// Whether what was read has an imaginary part.
type Read = Result<bool, Problem>;

impl Parser<'_> {
    fn refuse<T>(&self, what: String) -> Result<T, Problem> {
        Err(Problem { at: self.at + 1, what })
    }

    /// The next character that is no space.
    fn peek(&mut self) -> Option<char> {
        while self.characters.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.characters.get(self.at).copied()
    }

    fn take(&mut self, sign: char) -> bool {
        let there = self.peek() == Some(sign);
        self.at += usize::from(there);
        there
    }

    fn expect(&mut self, sign: char) -> Result<(), Problem> {
        if self.take(sign) { Ok(()) } else { self.refuse(format!("`{sign}` is missing")) }
    }

    fn sum(&mut self) -> Read {
        self.nesting += 1;
        if self.nesting > MAX_NESTING {
            return self.refuse(format!("nested deeper than {MAX_NESTING}"));
        }
        let mut complex = self.product()?;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            self.at += 1;
            complex |= self.product()?;
            self.steps.push(if sign == '+' { Step::Add } else { Step::Subtract });
        }
        self.nesting -= 1;
        Ok(complex)
    }

    fn product(&mut self) -> Read {
        let mut complex = self.signed()?;
        while let Some(sign @ ('*' | '/')) = self.peek() {
            self.at += 1;
            complex |= self.signed()?;
            let real = !complex;
            self.steps.push(if sign == '*' { Step::Multiply { real } } else { Step::Divide { real } });
        }
        Ok(complex)
    }

    fn signed(&mut self) -> Read {
        let mut negative = false;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            self.at += 1;
            negative ^= sign == '-';
        }
        let complex = self.power()?;
        if negative {
            self.steps.push(Step::Negate);
        }
        Ok(complex)
    }

    fn power(&mut self) -> Read {
        let complex = self.operand()?;
        if self.take('^') {
            let exponent = self.exponent()?;
            self.steps.push(Step::Power { exponent, real: !complex });
            if self.peek() == Some('^') {
                return self.refuse("a power of a power needs parentheses".into());
            }
        }
        Ok(complex)
    }

    fn exponent(&mut self) -> Result<i8, Problem> {
        let bracket = self.take('(');
        let negative = self.take('-');
        self.peek();
        let digits: String = self.characters[self.at..].iter().take_while(|c| c.is_ascii_digit()).collect();
        self.at += digits.len();
        let fraction = matches!(self.characters.get(self.at), Some('.' | 'e' | 'E'));
        let exponent = digits.parse::<i8>().ok().filter(|e| *e <= MAX_POWER && !fraction);
        let Some(exponent) = exponent else {
            return self.refuse(format!("an exponent is a whole number from -{MAX_POWER} to {MAX_POWER}"));
        };
        if bracket {
            self.expect(')')?;
        }
        Ok(if negative { -exponent } else { exponent })
    }

    fn operand(&mut self) -> Read {
        match self.peek() {
            Some('(') => {
                self.at += 1;
                let complex = self.sum()?;
                self.expect(')')?;
                Ok(complex)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.named(),
            Some(c) => self.refuse(format!("`{c}` is not expected here")),
            None => self.refuse("it ends too early".into()),
        }
    }

    fn number(&mut self) -> Read {
        let start = self.at;
        let digits = |parser: &mut Self| {
            while parser.characters.get(parser.at).is_some_and(char::is_ascii_digit) {
                parser.at += 1;
            }
        };
        digits(self);
        if self.characters.get(self.at) == Some(&'.') {
            self.at += 1;
            digits(self);
        }
        if matches!(self.characters.get(self.at), Some('e' | 'E')) {
            self.at += 1;
            if matches!(self.characters.get(self.at), Some('+' | '-')) {
                self.at += 1;
            }
            digits(self);
        }
        let text: String = self.characters[start..self.at].iter().collect();
        match text.parse::<f64>().ok().filter(|v| v.is_finite()) {
            Some(value) => {
                self.steps.push(Step::Number(value));
                Ok(false)
            }
            None => Err(Problem { at: start + 1, what: format!("`{text}` is not a number") }),
        }
    }

    fn named(&mut self) -> Read {
        let start = self.at;
        while self.characters.get(self.at).is_some_and(|c| c.is_alphanumeric() || *c == '_') {
            self.at += 1;
        }
        let name: String = self.characters[start..self.at].iter().collect();
        if let Some(function) = FUNCTIONS.iter().find(|(n, ..)| *n == name) {
            return self.call(*function, start);
        }
        if let Some((_, step)) = CONSTANTS.iter().find(|(n, _)| *n == name) {
            self.steps.push(*step);
            return Ok(*step == Step::ImaginaryUnit);
        }
        if let Some((_, variable)) = self.variables.iter().find(|(n, _)| *n == name) {
            self.steps.push(Step::Variable(*variable));
            return Ok(matches!(variable, Variable::X | Variable::Y | Variable::DriveX | Variable::DriveY));
        }
        let parameter = self.parameters.iter().position(|p| *p == name).and_then(|p| u8::try_from(p).ok());
        let Some(parameter) = parameter else {
            let known: Vec<&str> =
                self.variables.iter().map(|(n, _)| *n).chain(self.parameters.iter().copied()).collect();
            return Err(Problem {
                at: start + 1,
                what: format!("unknown name `{name}`; known here: {}", known.join(", ")),
            });
        };
        self.steps.push(Step::Parameter(parameter));
        Ok(false)
    }

    fn call(&mut self, (name, operands, takes_complex): (&str, usize, bool), start: usize) -> Read {
        self.expect('(')?;
        let mut complex = [false; 3];
        for (operand, complex) in complex.iter_mut().enumerate().take(operands) {
            if operand > 0 {
                self.expect(',')?;
            }
            *complex = self.sum()?;
        }
        self.expect(')')?;
        let any = complex.contains(&true);
        let condition = name == "if_positive" && complex[0];
        if (any && !takes_complex) || condition {
            let what = format!("{name} takes a real number: use abs, re or im of a complex one");
            return Err(Problem { at: start + 1, what });
        }
        self.steps.push(match name {
            "abs" if any => Step::Magnitude,
            "abs" => Step::Absolute,
            "re" => Step::RealPart,
            "im" => Step::ImaginaryPart,
            "conj" => Step::Conjugate,
            "sqrt" => Step::SquareRoot,
            "sin" => Step::Sine,
            "cos" => Step::Cosine,
            "exp" => Step::Exponential,
            "atan2" => Step::Arctangent2,
            "min" => Step::Smaller,
            "max" => Step::Larger,
            _ => Step::IfPositive,
        });
        Ok(any && matches!(name, "conj" | "if_positive"))
    }
}
