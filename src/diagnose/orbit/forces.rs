//! What pushes a satellite: the baseline a simulation claims, and the catalogue of what it may lack, each as columns of
//! acceleration that enter linearly with their coefficients.
//!
//! Directions (Arnold et al. 2015): D from the satellite to the Sun, Y = D x r / |D x r| along the solar panels' axis,
//! B = D x Y. Not here: how an acceleration becomes a position (see `arc`).

use nalgebra::{Matrix3, Vector3};

use crate::physics::earth_orientation::{EarthOrientation, EarthOrientationError, GpsInstant, Rotation};
use crate::physics::gravity_field::GravityField;
use crate::physics::integrator::State;
use crate::physics::third_body::{
    EARTH_RADIUS_M, GM_MOON_M3_S2, GM_SUN_M3_S2, MOON_RADIUS_M, SunMoon, SunMoonTable, solid_tide_acceleration,
    sunlit_fraction, third_body_acceleration,
};

const LIGHT_M_S: f64 = 299_792_458.0;
const EARTH_RATE_RAD_S: f64 = 7.292_115_9e-5;

/// Where the satellites fly: everything that depends on time alone.
#[derive(Debug, Clone)]
pub struct Environment {
    /// The Earth's rotation.
    pub rotation: Rotation,
    /// Sun and Moon.
    pub bodies: SunMoonTable,
    /// Gravity at the epoch.
    pub field: GravityField,
    /// What else acts.
    pub finer: Finer,
    /// How thin the air becomes with height.
    pub air: Air,
}

/// An exponential atmosphere about a height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    /// Where the density is that of the mean one, m.
    pub height_m: f64,
    /// In which it falls to 1/e, m.
    pub scale_height_m: f64,
}

impl Air {
    /// 3.2e-12 kg/m^3 at 400 km, scale height 60 km: mean Sun.
    pub const MEAN: Self = Self { height_m: 400e3, scale_height_m: 60e3 };

    /// The density of the mean atmosphere at a height, and another scale height about it.
    pub fn about(height_m: f64, scale_height_m: f64) -> Self {
        Self { height_m, scale_height_m }
    }

    fn density_kg_m3(&self, height_m: f64) -> f64 {
        let there = 3.2e-12 * (-(self.height_m - Self::MEAN.height_m) / Self::MEAN.scale_height_m).exp();
        there * (-(height_m - self.height_m) / self.scale_height_m).exp()
    }
}

/// Which finer terms act.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finer {
    /// The tide in the solid Earth, with the pull of the body that raises it.
    pub tide: bool,
    /// The Earth's relativistic term.
    pub relativity: bool,
}

impl Finer {
    /// All of them, as on every satellite.
    pub const ALL: Self = Self { tide: true, relativity: true };
}

impl Environment {
    /// For `span_s` seconds from `origin`.
    pub fn new(
        origin: GpsInstant,
        span_s: f64,
        eop: &EarthOrientation,
        field: GravityField,
    ) -> Result<Self, EarthOrientationError> {
        let rotation = Rotation::new(eop, origin, span_s)?;
        Ok(Self { rotation, bodies: SunMoonTable::new(origin, span_s), field, finer: Finer::ALL, air: Air::MEAN })
    }
}

/// A term of the force model beyond the central body; each has one column of acceleration or two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Term {
    /// Pull of the Sun.
    Sun,
    /// Pull of the Moon.
    Moon,
    /// The field's degrees from here to the file's end.
    DegreesFrom(usize),
    /// Sunlight's push away from the Sun, none in shadow.
    SolarRadiation,
    /// A constant along the panel axis, in shadow as well.
    YBias,
    /// A constant along B, none in shadow.
    BBias,
    /// Along B, with the cosine and the sine of the argument of latitude; none in shadow.
    OncePerRev,
    /// Air drag, for orbits low enough to have air.
    Drag,
    /// The day's denser air, beside drag.
    Bulge,
    /// A push that no catalogue has, which is never named: it shows what a name is worth.
    Unlisted(Unlisted),
}

/// Accelerations that stand for no physics in particular.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Unlisted {
    /// A constant in one direction of the orbit's own frame.
    Steady(Direction),
    /// The cosine and the sine of the argument of latitude in one.
    PerRevolution(Direction),
    /// What grows from nothing at the recording's first epoch in one; the coefficient is that of a day later.
    Growing(Direction),
    /// Away from the Earth while the Sun is over the horizon below, as light from the Earth pushes: the size is that under the Sun at one
    /// Earth radius.
    DaySide,
    /// The pull of the Sun taken away, from a simulation that has it and a recording that has not.
    NoSun,
    /// That of the Moon.
    NoMoon,
    /// These degrees of the field taken away, the first and the last.
    NoDegrees(usize, usize),
}

/// Along the radius, the track, or the orbit's normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Direction {
    /// Away from the Earth's centre.
    Radial,
    /// Square to the radius in the orbit's plane, ahead.
    Along,
    /// Along the orbit's normal.
    Cross,
}

impl Direction {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Radial, Self::Along, Self::Cross];

    /// The word in answers.
    pub fn name(self) -> &'static str {
        ["radial", "along", "cross"][self as usize]
    }

    fn unit(self, state: &State) -> Vector3<f64> {
        let radial = state.r.normalize();
        let normal = state.r.cross(&state.v).normalize();
        match self {
            Self::Radial => radial,
            Self::Along => normal.cross(&radial),
            Self::Cross => normal,
        }
    }
}

impl Term {
    /// The catalogue's name.
    pub fn id(self) -> &'static str {
        match self {
            Self::Sun => "third_body_sun",
            Self::Moon => "third_body_moon",
            Self::DegreesFrom(_) => "gravity_degree",
            Self::SolarRadiation => "solar_radiation_pressure",
            Self::YBias => "srp_y_bias",
            Self::BBias => "srp_b_bias",
            Self::OncePerRev => "srp_once_per_rev",
            Self::Drag => "aerodynamic_drag",
            Self::Bulge => "diurnal_bulge",
            Self::Unlisted(_) => "unlisted",
        }
    }

    /// The name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sun => "Pull of the Sun",
            Self::Moon => "Pull of the Moon",
            Self::DegreesFrom(_) => "Higher degrees of the gravity field",
            Self::SolarRadiation => "Solar radiation pressure",
            Self::YBias => "Constant along the solar panels' axis",
            Self::BBias => "Constant along B, across the panels' axis and the Sun's direction",
            Self::OncePerRev => "Once-per-revolution push along B",
            Self::Drag => "Aerodynamic drag",
            Self::Bulge => "Day-night variation of density",
            Self::Unlisted(_) => "A push that no catalogue has",
        }
    }

    /// Names of the coefficients.
    pub fn parameters(self) -> &'static [&'static str] {
        match self {
            Self::Sun | Self::Moon | Self::DegreesFrom(_) | Self::Drag => &["fraction"],
            Self::SolarRadiation
            | Self::YBias
            | Self::BBias
            | Self::Unlisted(Unlisted::Steady(_) | Unlisted::Growing(_)) => &["accel_m_s2"],
            Self::OncePerRev | Self::Unlisted(Unlisted::PerRevolution(_)) => &["cos_m_s2", "sin_m_s2"],
            Self::Bulge => &["amplitude"],
            Self::Unlisted(_) => &["fraction"],
        }
    }

    /// Unit of the coefficients.
    pub fn unit(self) -> &'static str {
        if self.is_known_size() || matches!(self, Self::Drag | Self::Bulge) { "1" } else { "m/s^2" }
    }

    /// Whether physics fixes the coefficient beforehand: then it must come out as one.
    pub fn is_known_size(self) -> bool {
        use Unlisted::{NoDegrees, NoMoon, NoSun};
        matches!(self, Self::Sun | Self::Moon | Self::DegreesFrom(_) | Self::Unlisted(NoSun | NoMoon | NoDegrees(..)))
    }

    /// A typical coefficient, to make columns comparable in size.
    pub fn scale(self) -> f64 {
        match self {
            Self::SolarRadiation => 1e-7,
            Self::YBias | Self::BBias | Self::OncePerRev => 1e-9,
            Self::Unlisted(
                Unlisted::Steady(_) | Unlisted::Growing(_) | Unlisted::PerRevolution(_) | Unlisted::DaySide,
            ) => 1e-9,
            Self::Sun | Self::Moon | Self::DegreesFrom(_) | Self::Drag | Self::Bulge | Self::Unlisted(_) => 1.0,
        }
    }
}

/// What the simulation claims to include.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Baseline {
    /// Degree of the gravity field.
    pub degree: usize,
    /// Terms taken as known: Sun, Moon.
    pub known: Vec<Term>,
    /// Terms included whose coefficients belong to the satellite, and are estimated with its state.
    pub estimated: Vec<Term>,
}

/// The geometry of one moment, shared by all terms.
pub struct Moment {
    t_s: f64,
    state: State,
    rotation: Matrix3<f64>,
    bodies: SunMoon,
    sunlit: f64,
}

impl Moment {
    /// At `t_s` in this state.
    pub fn new(environment: &Environment, t_s: f64, state: &State) -> Self {
        let bodies = environment.bodies.at(t_s);
        let sunlit = sunlit(&state.r, &bodies);
        Self { t_s, state: *state, rotation: environment.rotation.inertial_to_fixed(t_s), bodies, sunlit }
    }

    /// The Earth's axis in the inertial frame.
    pub fn pole(&self) -> Vector3<f64> {
        self.rotation.row(2).transpose()
    }

    /// The baseline's acceleration, m/s^2.
    pub fn baseline(&self, environment: &Environment, baseline: &Baseline) -> Vector3<f64> {
        let fixed = environment.field.acceleration(&(self.rotation * self.state.r), baseline.degree);
        let known = |sum, term: &Term| sum + self.columns(environment, *term)[0];
        let newton = self.rotation.tr_mul(&fixed);
        let relativity = environment.finer.relativity.then(|| self.relativity(environment.field.gm_m3_s2()));
        baseline.known.iter().fold(newton + relativity.unwrap_or_default(), known)
    }

    /// A term's acceleration for unit coefficients; unused columns are zero.
    pub fn columns(&self, environment: &Environment, term: Term) -> [Vector3<f64>; 2] {
        let r = &self.state.r;
        let zero = Vector3::zeros();
        let to_sun = (self.bodies.sun_m - r).normalize();
        match term {
            Term::Sun => [pull_and_tide(environment.finer, r, &self.bodies.sun_m, GM_SUN_M3_S2), zero],
            Term::Moon => [pull_and_tide(environment.finer, r, &self.bodies.moon_m, GM_MOON_M3_S2), zero],
            Term::DegreesFrom(from) => {
                let field = &environment.field;
                let fixed = field.acceleration_of_degrees(&(self.rotation * r), from, field.degree());
                [self.rotation.tr_mul(&fixed), zero]
            }
            Term::SolarRadiation => [to_sun * -self.sunlit, zero],
            Term::YBias => [panel_axis(r, &to_sun), zero],
            Term::BBias => [to_sun.cross(&panel_axis(r, &to_sun)) * self.sunlit, zero],
            Term::OncePerRev => {
                let b = to_sun.cross(&panel_axis(r, &to_sun));
                let (sin, cos) = self.argument_of_latitude().sin_cos();
                [b * cos * self.sunlit, b * sin * self.sunlit]
            }
            Term::Drag => [self.drag(environment.air), zero],
            Term::Bulge => [self.drag(environment.air) * self.cosine_from_bulge(), zero],
            Term::Unlisted(unlisted) => self.unlisted(environment, unlisted),
        }
    }

    fn unlisted(&self, environment: &Environment, unlisted: Unlisted) -> [Vector3<f64>; 2] {
        let taken_away = |term: Term| [-self.columns(environment, term)[0], Vector3::zeros()];
        match unlisted {
            Unlisted::Steady(direction) => [direction.unit(&self.state), Vector3::zeros()],
            Unlisted::PerRevolution(direction) => {
                let (sin, cos) = self.argument_of_latitude().sin_cos();
                let unit = direction.unit(&self.state);
                [unit * cos, unit * sin]
            }
            Unlisted::Growing(direction) => [direction.unit(&self.state) * (self.t_s / 86_400.0), Vector3::zeros()],
            Unlisted::DaySide => {
                let up = self.state.r.normalize();
                let day = self.bodies.sun_m.normalize().dot(&up).max(0.0);
                [up * (day * (EARTH_RADIUS_M / self.state.r.norm()).powi(2)), Vector3::zeros()]
            }
            Unlisted::NoSun => taken_away(Term::Sun),
            Unlisted::NoMoon => taken_away(Term::Moon),
            Unlisted::NoDegrees(from, to) => {
                let fixed = environment.field.acceleration_of_degrees(&(self.rotation * self.state.r), from, to);
                [-self.rotation.tr_mul(&fixed), Vector3::zeros()]
            }
        }
    }

    /// The Earth's Schwarzschild term (IERS Conventions 2010, equation 10.12, first part), 3e-10 m/s^2 at a GPS orbit:
    /// a = GM/(c^2 r^3) ((4 GM/r - v.v) r + 4 (r.v) v).
    fn relativity(&self, gm: f64) -> Vector3<f64> {
        let State { r, v } = &self.state;
        let distance = r.norm();
        let size = gm / (LIGHT_M_S * LIGHT_M_S * distance.powi(3));
        (r * (4.0 * gm / distance - v.norm_squared()) + v * (4.0 * r.dot(v))) * size
    }

    fn argument_of_latitude(&self) -> f64 {
        let normal = self.state.r.cross(&self.state.v).normalize();
        let node = Vector3::z().cross(&normal).normalize();
        self.state.r.dot(&normal.cross(&node)).atan2(self.state.r.dot(&node))
    }

    /// Cosine of the angle from the bulge's apex: the Sun's direction turned 30 degrees eastward.
    fn cosine_from_bulge(&self) -> f64 {
        let sun = self.bodies.sun_m.normalize();
        let pole = self.pole();
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let apex = sun * cos + pole.cross(&sun) * sin + pole * (pole.dot(&sun) * (1.0 - cos));
        apex.dot(&self.state.r.normalize())
    }

    /// Drag of a satellite of 0.01 m^2/kg and coefficient 2.2 in an exponential atmosphere. The form is what is looked for; the fraction
    /// carries what is not known.
    fn drag(&self, air: Air) -> Vector3<f64> {
        let wind = self.state.v - self.pole().cross(&self.state.r) * EARTH_RATE_RAD_S;
        let density = air.density_kg_m3(height_m(&self.state.r, &self.pole()));
        wind * (-0.5 * density * 2.2 * 0.01 * wind.norm())
    }
}

/// Height over the Earth's ellipsoid, which the air follows, m: to the first order in its flattening.
fn height_m(r_m: &Vector3<f64>, pole: &Vector3<f64>) -> f64 {
    const FLATTENING: f64 = 1.0 / 298.257;
    let distance = r_m.norm();
    let sine = r_m.dot(pole) / distance;
    distance - EARTH_RADIUS_M * (1.0 - FLATTENING * sine * sine)
}

/// Light left by the Earth and the Moon.
pub fn sunlit(r_m: &Vector3<f64>, bodies: &SunMoon) -> f64 {
    let by_earth = sunlit_fraction(r_m, &bodies.sun_m, &Vector3::zeros(), EARTH_RADIUS_M);
    by_earth * sunlit_fraction(r_m, &bodies.sun_m, &bodies.moon_m, MOON_RADIUS_M)
}

/// What a distant body does to a satellite: its own pull, and that of the tide it raises in the solid Earth.
fn pull_and_tide(finer: Finer, r_m: &Vector3<f64>, body_m: &Vector3<f64>, gm_m3_s2: f64) -> Vector3<f64> {
    let tide = finer.tide.then(|| solid_tide_acceleration(r_m, body_m, gm_m3_s2));
    third_body_acceleration(r_m, body_m, gm_m3_s2) + tide.unwrap_or_default()
}

fn panel_axis(r_m: &Vector3<f64>, to_sun: &Vector3<f64>) -> Vector3<f64> {
    to_sun.cross(r_m).normalize()
}
