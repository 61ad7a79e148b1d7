//! Macro parameters: a handful of sliders, each of which blends whole-body morph targets.

/// MakeHuman's macro sliders, each 0..=1 with the middle neutral.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Macros {
    /// 0 female, 1 male.
    pub gender: f32,
    /// 0 baby, 0.1875 child, 0.5 young adult, 1 old.
    pub age: f32,
    /// Muscle.
    pub muscle: f32,
    /// Weight.
    pub weight: f32,
    /// Height.
    pub height: f32,
    /// 0 uncommon, 1 ideal proportions.
    pub proportions: f32,
    /// Shares of the African, Asian and Caucasian faces; they sum to 1.
    pub races: [f32; 3],
}

impl Macros {
    /// Weight of a target: the product of what the words of its file name ask for. `None` where it is zero, and for
    /// targets that are not macros.
    #[must_use]
    pub fn weight(&self, target: &str) -> Option<f32> {
        let words = target.strip_prefix("macrodetails/")?;
        let file = words.rsplit('/').next()?;
        let mut product = 1.0;
        for word in file.split('-') {
            product *= self.factor(word)?;
        }
        (product > 1e-6).then_some(product)
    }

    fn factor(&self, word: &str) -> Option<f32> {
        let three = |kind: &str, value: f32| {
            let (max, min) = ((2.0 * value - 1.0).max(0.0), (1.0 - 2.0 * value).max(0.0));
            match word.strip_suffix(kind)? {
                "max" => Some(max),
                "min" => Some(min),
                "average" => Some(1.0 - max - min),
                _ => None,
            }
        };
        let [baby, child, young, old] = self.ages();
        Some(match word {
            "universal" => 1.0,
            "male" => self.gender,
            "female" => 1.0 - self.gender,
            "baby" => baby,
            "child" => child,
            "young" => young,
            "old" => old,
            "african" => self.races[0],
            "asian" => self.races[1],
            "caucasian" => self.races[2],
            "idealproportions" => (2.0 * self.proportions - 1.0).max(0.0),
            "uncommonproportions" => (1.0 - 2.0 * self.proportions).max(0.0),
            _ => three("muscle", self.muscle)
                .or_else(|| three("weight", self.weight))
                .or_else(|| three("height", self.height))?,
        })
    }

    fn ages(&self) -> [f32; 4] {
        let a = self.age;
        if a < 0.5 {
            let young = ((a - 0.1875) * 3.2).max(0.0);
            let baby = (1.0 - 5.333 * a).max(0.0);
            let child = ((5.333 * a).min(1.0) - young).max(0.0);
            [baby, child, young, 0.0]
        } else {
            let old = (2.0 * a - 1.0).max(0.0);
            [0.0, 0.0, 1.0 - old, old]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAN: Macros = Macros {
        gender: 1.0,
        age: 0.5,
        muscle: 0.6,
        weight: 0.47,
        height: 0.5,
        proportions: 0.8,
        races: [0.0, 0.0, 1.0],
    };

    #[test]
    fn the_weight_of_a_macro_target_is_the_product_of_its_words() {
        let weigh = |name: &str| MAN.weight(name);
        assert_eq!(
            weigh("macrodetails/caucasian-male-young"),
            Some(1.0),
            "race"
        );
        assert_eq!(weigh("macrodetails/asian-male-young"), None, "other race");
        assert_eq!(weigh("mouth/mouth-up"), None, "not a macro");
        let mixed = weigh("macrodetails/universal-male-young-maxmuscle-minweight");
        assert!(
            mixed.is_some_and(|w| (w - 0.2 * 0.06).abs() < 1e-6),
            "{mixed:?}"
        );
        let ideal = weigh(
            "macrodetails/proportions/male-young-averagemuscle-averageweight-idealproportions",
        );
        assert!(
            ideal.is_some_and(|w| (w - 0.8 * 0.94 * 0.6).abs() < 1e-6),
            "{ideal:?}"
        );
    }
}
