//! What a law may follow together: terms of variables on the ancillary grid, each about one in size, measured as the recording is.

use crate::diagnose::measure::{coverage, relaxing, union};
use crate::diagnose::scene::Scene;
use crate::math::rms::rms_about_mean;
use crate::math::shared_work;
use crate::physics::{Vec3, time};

/// Terms that are asked together, those of a later level added to those before.
pub struct Question {
    /// In words: what they are of.
    pub what: String,
    /// The formula of each.
    pub said: Vec<String>,
    /// Each at the windows.
    pub series: Vec<Vec<f64>>,
    /// How many there are up to each level.
    pub until: Vec<usize>,
}

/// A number on the ancillary grid.
#[derive(Clone)]
struct Variable {
    said: String,
    values: Vec<f64>,
}

/// Share of the grid at either end beyond which a number is held: a law of a few rows is no law of all.
const HELD: f64 = 0.02;
/// Times in which what remembers forgets, s.
const MEMORIES_S: [f64; 3] = [1000.0, 3000.0, 10_000.0];
/// Ends of the times since an entry, s.
const SINCE_S: [f64; 7] = [0.0, 300.0, 900.0, 1800.0, 3600.0, 7200.0, 14_400.0];
/// Kinds of the log that are asked.
const KINDS_MAX: usize = 4;

/// All that is asked.
pub fn questions(scene: &Scene) -> Vec<Question> {
    let mut all = shared_work::map(&ASKED, |asked| asked(scene));
    all.extend(scene.case.kinds_tried().into_iter().flat_map(|kind| after(scene, kind)));
    all
}

const ASKED: [fn(&Scene) -> Question; 10] = [
    |s| polynomial(s, "the place on the Earth", &place(s), 4),
    |s| polynomial(s, "the Sun in the body", &[sunlight(s), vec![sunlit(s)]].concat(), 3),
    |s| polynomial(s, "the velocity in the body", &ram(s), 3),
    |s| polynomial(s, "the nadir in the body", &nadir(s), 3),
    |s| polynomial(s, "the geomagnetic field in the body", &field(s), 3),
    |s| polynomial(s, "the modelled signal", &signal(s), 3),
    |s| polynomial(s, "two numbers at once", &numbers(s), 2),
    |s| products(s, "a number and a phase", &numbers(s), &phases(s)),
    |s| products(s, "a switch and anything else", &switches(s), &anything(s)),
    |s| polynomial(s, "what was before", &memories(s), 1),
];

impl Question {
    fn new(what: impl Into<String>) -> Self {
        Self { what: what.into(), said: Vec::new(), series: Vec::new(), until: Vec::new() }
    }

    /// One level more.
    fn then(mut self, scene: &Scene, terms: &[Variable]) -> Self {
        for term in terms {
            self.said.push(term.said.clone());
            self.series.push(scene.measurement.apply(&term.values));
        }
        self.until.push(self.series.len());
        self
    }
}

/// Products of the variables of every power up to the highest, a level each.
fn polynomial(scene: &Scene, what: &str, variables: &[Variable], power: usize) -> Question {
    let mut question = Question::new(what);
    // The products of a power, each with the place of its last factor.
    let mut last: Vec<(usize, Variable)> = variables.iter().cloned().enumerate().collect();
    for level in 1..=power {
        question = question.then(scene, &last.iter().map(|(_, term)| term.clone()).collect::<Vec<Variable>>());
        if level < power {
            let times = |(from, term): &(usize, Variable)| -> Vec<(usize, Variable)> {
                (*from..variables.len()).map(|i| (i, term.times(&variables[i]))).collect()
            };
            last = last.iter().flat_map(times).collect();
        }
    }
    question
}

/// Variables of two kinds, and as a second level the products of one of each.
fn products(scene: &Scene, what: &str, one: &[Variable], other: &[Variable]) -> Question {
    let of_both: Vec<Variable> = one.iter().flat_map(|a| other.iter().map(|b| a.times(b))).collect();
    Question::new(what).then(scene, &[one, other].concat()).then(scene, &of_both)
}

/// Whatever comes after the start, and after the end, of the entries of a kind, until the next: a push in each of some times since. What
/// begins once is a leak or a step.
fn after(s: &Scene, kind: &str) -> Vec<Question> {
    let [from_s, to_s] = s.span_s();
    let spans = s.case.spans(kind);
    let of_edge = |(edge, of): (&str, usize)| {
        let mut at_s: Vec<f64> = spans.iter().map(|span| span[of]).collect();
        at_s.sort_unstable_by(f64::total_cmp);
        let since = |[first, last]: [f64; 2]| {
            let next = at_s.iter().skip(1).copied().chain([f64::INFINITY]);
            let pushes: Vec<[f64; 2]> =
                at_s.iter().zip(next).map(|(t, next)| [(t + first).min(next), (t + last).min(next)]).collect();
            (format!("(from {first:.0} s to {last:.0} s after the {edge} of {kind})"), coverage(s.clock_s(), &pushes))
        };
        let inside = at_s.iter().filter(|t| (from_s..to_s).contains(*t)).count();
        let (said, series): (Vec<String>, Vec<Vec<f64>>) = SINCE_S.windows(2).map(|x| since([x[0], x[1]])).unzip();
        let what = format!("the time since the {edge} of {kind}");
        (inside > 1).then(|| Question { what, until: vec![said.len()], said, series })
    };
    [("start", 0), ("end", 1)].into_iter().filter_map(of_edge).collect()
}

impl Variable {
    fn new(said: impl Into<String>, values: Vec<f64>) -> Self {
        Self { said: said.into(), values }
    }

    fn times(&self, other: &Self) -> Self {
        let values = self.values.iter().zip(&other.values).map(|(a, b)| a * b).collect();
        Self::new(format!("{} {}", self.said, other.said), values)
    }

    /// About its middle, over half of what it has between its ends, beyond which it is held.
    fn scaled(said: &str, values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
        let [low, high] = [HELD, 1.0 - HELD].map(at);
        let [middle, half] = [0.5 * (low + high), (0.5 * (high - low)).max(f64::MIN_POSITIVE)];
        let held = values.iter().map(|x| (x.clamp(low, high) - middle) / half).collect();
        Self::new(format!("({said} held within {low:.4e} and {high:.4e}, less {middle:.4e}, over {half:.4e})"), held)
    }
}

/// The parts of a vector.
fn parts(s: &Scene, said: [&str; 3], v: impl Fn(usize) -> Vec3) -> Vec<Variable> {
    let values: Vec<Vec3> = (0..s.grid_s.len()).map(v).collect();
    (0..3).map(|k| Variable::new(said[k], values.iter().map(|v| v[k]).collect())).collect()
}

fn place(s: &Scene) -> Vec<Variable> {
    let unix_s = s.unix_s();
    parts(s, ["cos(latitude) cos(longitude)", "cos(latitude) sin(longitude)", "sin(latitude)"], |g| {
        let (sin, cos) = time::gmst_rad(unix_s[g]).sin_cos();
        let r = s.r_m[g].normalize();
        Vec3::new(cos * r.x + sin * r.y, cos * r.y - sin * r.x, r.z)
    })
}

fn sunlight(s: &Scene) -> Vec<Variable> {
    parts(s, ["nu sx", "nu sy", "nu sz"], |g| s.body[g] * s.sun[g] * s.sunlit[g])
}

fn sunlit(s: &Scene) -> Variable {
    Variable::new("nu", s.sunlit.clone())
}

fn ram(s: &Scene) -> Vec<Variable> {
    parts(s, ["vx/|v|", "vy/|v|", "vz/|v|"], |g| s.body[g] * s.v_m_s[g].normalize())
}

fn nadir(s: &Scene) -> Vec<Variable> {
    parts(s, ["rx/|r|", "ry/|r|", "rz/|r|"], |g| s.body[g] * s.r_m[g].normalize())
}

fn field(s: &Scene) -> Vec<Variable> {
    let strongest_t = s.field_body_t.iter().map(Vec3::norm).fold(f64::MIN_POSITIVE, f64::max);
    let said = ["x", "y", "z"].map(|axis| format!("B{axis}/{strongest_t:.3e}"));
    parts(s, said.each_ref().map(String::as_str), |g| s.field_body_t[g] / strongest_t)
}

fn signal(s: &Scene) -> Vec<Variable> {
    let named = ["mx", "my", "mz"].into_iter().zip(&s.simulated_grid_ng);
    named.map(|(said, values)| Variable::scaled(said, values)).collect()
}

/// Numbers that change with time.
fn numbers(s: &Scene) -> Vec<Variable> {
    let mut all = driving(s);
    all.push(Variable::scaled("t", &s.grid_s));
    all.push(Variable::new("sin(latitude)", s.r_m.iter().map(|r| r.z / r.norm()).collect()));
    all
}

/// Those that something may follow late.
fn driving(s: &Scene) -> Vec<Variable> {
    let norm = |v: &[Vec3]| v.iter().map(Vec3::norm).collect::<Vec<f64>>();
    vec![
        Variable::scaled("T", &s.temperature_c),
        Variable::scaled("rho", &s.density_kg_m3),
        Variable::scaled("|w|", &norm(&s.w_rad_s)),
        Variable::scaled("|B|", &norm(&s.field_body_t)),
    ]
}

/// Angles that go round.
fn phases(s: &Scene) -> Vec<Variable> {
    let (u, noon) = s.orbit_angles_rad();
    let local = s.hour_angle_rad();
    let circle = |(said, angle): (&str, &Vec<f64>)| {
        let (sines, cosines): (Vec<f64>, Vec<f64>) = angle.iter().map(|a| a.sin_cos()).unzip();
        [Variable::new(format!("sin({said})"), sines), Variable::new(format!("cos({said})"), cosines)]
    };
    [("u", &u), ("u - u_noon", &noon), ("local time - 12 h", &local)].into_iter().flat_map(circle).collect()
}

/// What is there or not.
fn switches(s: &Scene) -> Vec<Variable> {
    std::iter::once(sunlit(s)).chain(entries(s)).collect()
}

/// Whether an entry of a kind lasts, at each row of the grid: of the kinds of which that says most.
fn entries(s: &Scene) -> Vec<Variable> {
    let lasts = |kind: &str| Variable::new(format!("({kind} lasts)"), coverage(&s.grid_s, &union(s.case.spans(kind))));
    let varies = |v: &Variable| rms_about_mean(&v.values);
    let mut all: Vec<Variable> = s.case.kinds_tried().into_iter().map(lasts).collect();
    all.sort_by(|a, b| varies(b).total_cmp(&varies(a)));
    all.truncate(KINDS_MAX);
    all
}

fn anything(s: &Scene) -> Vec<Variable> {
    let mut all = [numbers(s), phases(s), ram(s), nadir(s), field(s)].concat();
    all.extend(entries(s));
    all
}

/// What was before, as something that follows late remembers it.
fn memories(s: &Scene) -> Vec<Variable> {
    let mut driving = driving(s);
    driving.push(Variable::scaled("|dw/dt|", &s.wdot_rad_s2.iter().map(Vec3::norm).collect::<Vec<f64>>()));
    driving.extend(switches(s));
    let remembered = |d: &Variable, tau_s: f64| {
        Variable::new(format!("({}, relaxing in {tau_s:.0} s)", d.said), relaxing(&s.grid_s, &d.values, tau_s))
    };
    driving.iter().flat_map(|d| MEMORIES_S.map(|tau_s| remembered(d, tau_s))).collect()
}
