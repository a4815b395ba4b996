//! What is odd about the data.

use recording::Finding;

/// One remark on the quality of the data.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Quality {
    /// Topic; empty where the whole file is meant.
    pub topic: String,
    /// Kind, one word.
    pub kind: &'static str,
    /// How often.
    pub count: u64,
    /// When first (s).
    pub t_s: Option<f64>,
    /// One line for people.
    pub text: String,
    /// Whether something that the file once held is lost.
    #[serde(skip)]
    pub loss: bool,
}

impl Quality {
    /// Something worth knowing of a topic, by which nothing is lost.
    pub fn remark(topic: &str, kind: &'static str, text: String) -> Self {
        Quality {
            topic: topic.to_owned(),
            kind,
            count: 1,
            t_s: None,
            text,
            loss: false,
        }
    }

    /// The text with its topic.
    pub fn told(&self) -> String {
        match self.topic.as_str() {
            "" => self.text.clone(),
            topic => format!("{topic}: {}", self.text),
        }
    }
}

impl From<Finding> for Quality {
    fn from(found: Finding) -> Self {
        Quality {
            topic: found.topic,
            kind: found.kind.word(),
            count: found.count,
            t_s: found.t_s,
            text: found.text,
            loss: found.kind.is_loss(),
        }
    }
}
