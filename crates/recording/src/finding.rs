//! What a reader remarks on: damage, gaps, odd values. Each is counted, placed and said in one line.

use std::fmt;

/// What kind of oddity a [`Finding`] is. The word in machine-readable output is [`Kind::word`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A stretch without messages on a topic that is otherwise regular.
    Gap,
    /// NaN or infinite values.
    Nan,
    /// Messages with the log time of the one before.
    Duplicate,
    /// Messages whose log time lies before that of the one before.
    Backward,
    /// Log time and header stamp differ by a constant.
    ClockOffset,
    /// Log time and header stamp run at different rates.
    ClockDrift,
    /// A field that the message declares as not given (covariance −1).
    AbsentField,
    /// Header stamps that are zero.
    ZeroStamp,
    /// Messages dated long before all others, which no time is counted from.
    Early,
    /// Times outside what nanoseconds in 63 bits can hold (beyond the year 2262).
    TimeOutOfRange,
    /// A part of the file whose checksum does not match.
    BadCrc,
    /// A chunk that cannot be decompressed or read.
    BadChunk,
    /// A chunk or message larger than the reader will take.
    TooLarge,
    /// The file ends before its records do.
    Truncated,
    /// Bytes that are not a record, or records of unknown kind.
    BadRecord,
    /// The summary at the end of the file is missing or disagrees with the content.
    BadSummary,
    /// The summary gives another first or last log time than the messages have.
    SummaryTimes,
    /// A schema or channel that is defined a second time, differently.
    Redefined,
    /// Messages that do not fit their schema.
    Undecodable,
    /// A channel for whose encoding or schema there is no decoder.
    NoDecoder,
    /// A channel whose schema cannot be understood, so that its messages cannot be read.
    BadSchema,
    /// A schema that is not what it should be, though the messages are read.
    OddSchema,
    /// Messages of a channel that nothing in the file defines.
    UnknownChannel,
    /// Messages with bytes left over after the last field of the schema.
    TrailingBytes,
    /// Sequences with more items than are made into signals.
    LongSequence,
    /// A place of a list that holds now one thing, now another, as the names that its items carry say.
    MixedItems,
}

impl Kind {
    /// The word used in JSON and tables.
    pub fn word(self) -> &'static str {
        match self {
            Kind::Gap => "gap",
            Kind::Nan => "nan",
            Kind::Duplicate => "duplicate",
            Kind::Backward => "backward",
            Kind::ClockOffset => "clock_offset",
            Kind::ClockDrift => "clock_drift",
            Kind::AbsentField => "absent_field",
            Kind::ZeroStamp => "zero_stamp",
            Kind::Early => "early",
            Kind::TimeOutOfRange => "time_out_of_range",
            Kind::BadCrc => "bad_crc",
            Kind::BadChunk => "bad_chunk",
            Kind::TooLarge => "too_large",
            Kind::Truncated => "truncated",
            Kind::BadRecord => "bad_record",
            Kind::BadSummary => "bad_summary",
            Kind::SummaryTimes => "summary_times",
            Kind::Redefined => "redefined",
            Kind::Undecodable => "undecodable",
            Kind::NoDecoder => "no_decoder",
            Kind::BadSchema => "bad_schema",
            Kind::OddSchema => "odd_schema",
            Kind::UnknownChannel => "unknown_channel",
            Kind::TrailingBytes => "trailing_bytes",
            Kind::LongSequence => "long_sequence",
            Kind::MixedItems => "mixed_items",
        }
    }

    /// Whether something that the file once held could not be used: the exit code is 3 then.
    ///
    /// Odd values and clocks are remarks, not losses; a channel in an encoding that nobody reads is skipped by kind, not lost.
    pub fn is_loss(self) -> bool {
        matches!(
            self,
            Kind::BadCrc
                | Kind::BadChunk
                | Kind::TooLarge
                | Kind::Truncated
                | Kind::BadRecord
                | Kind::BadSummary
                | Kind::Redefined
                | Kind::BadSchema
                | Kind::Undecodable
                | Kind::UnknownChannel
                | Kind::TimeOutOfRange
        )
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// One remark: what, where, how often, and the sentence for people.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The topic, or empty where the file as a whole is meant.
    pub topic: String,
    /// What kind of oddity.
    pub kind: Kind,
    /// How many times it occurs.
    pub count: u64,
    /// When it first occurs, seconds since [`Info::start_ns`](crate::read::Info::start_ns); `None` where time means nothing.
    pub t_s: Option<f64>,
    /// One line for people, without the topic.
    pub text: String,
}

impl Finding {
    /// One that has no place in time.
    pub(crate) fn new(topic: &str, kind: Kind, count: u64, text: String) -> Self {
        Self {
            topic: topic.to_owned(),
            kind,
            count,
            t_s: None,
            text,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.topic.is_empty() {
            write!(f, "{}: ", self.topic)?;
        }
        f.write_str(&self.text)
    }
}
