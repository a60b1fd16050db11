//! Tables of points and poses as text, written by this and other programs.
//!
//! A `Reader` takes the lines of a table one by one. Fields are separated by commas, semicolons or tabs, as in the
//! first line; a field in quotes may contain the separator. Empty lines and lines that begin with `#` are skipped.
//! Numbers have a decimal point; a decimal comma is refused.
//!
//! | column | content |
//! |---|---|
//! | `x`, `y`, `z` | coordinates in the table's own frame; `scene_x`, `pos_x`, `position.x` are the same |
//! | `r`, `a`, `s`; `l`, `p`, `s` | coordinates along the patient's axes: right or left, anterior or posterior, superior |
//! | `tx`, `ty`, `tz`, `tracker_x` | coordinates in the tracker's frame |
//! | `qw`, `qx`, `qy`, `qz` | unit quaternion, in any order of the columns |
//! | `time`, `name` or `label`, `status`, `event`, `defined` | defined by each reader |
//!
//! A unit follows a name: `x_mm`, `x_cm`, `x_m`, `x_in`, `time_s`, `time_ms`; `X [m]` is the same as `x_m`. The three
//! coordinates of a position have a unit either all or not at all. Columns may be in any order. Columns with unknown
//! or ambiguous names are refused.

mod column;
mod layout;
mod slicer;
mod split;

use thiserror::Error;

use crate::pose::PoseError;

pub use column::{Column, Frame, Meaning};
pub use layout::{Layout, Position, refuse};
pub(crate) use slicer::{System, markups};
pub use split::{finite, is_absent, number, quote};

/// Faults of a table's lines or columns.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum TableFault {
    /// A column with an unknown name.
    #[error("unknown column {name}{suggestion}; the columns are {known}")]
    Unknown {
        /// Name of the column, quoted.
        name: String,
        /// Nearest known name as text to append, or empty.
        suggestion: String,
        /// Column names of this kind of table.
        known: &'static str,
    },
    /// A column that is ambiguous, or does not belong to this kind of table.
    #[error("column {name} is not read: {reason}")]
    Refused {
        /// Name of the column, quoted.
        name: String,
        /// Reason and advice.
        reason: String,
    },
    /// Two columns with the same meaning.
    #[error("column {name} is there twice{other}")]
    Twice {
        /// Name of the column, quoted.
        name: String,
        /// The other column's name as text to append; empty if both names are equal.
        other: String,
    },
    /// A missing column that is needed.
    #[error("column `{name}` is missing; the columns are {known}")]
    Missing {
        /// Name of the column.
        name: String,
        /// Column names of this kind of table.
        known: &'static str,
    },
    /// Numbers without column names above them.
    #[error("the first line that is no comment must name the columns, as `time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz`")]
    NoHead,
    /// A line with more or fewer fields than there are columns.
    #[error("{found} fields; the head has {columns}{hint}")]
    Fields {
        /// Number of fields found.
        found: usize,
        /// Number of columns.
        columns: usize,
        /// Likely cause and advice, or empty.
        hint: &'static str,
    },
    /// A malformed line of a table without column names.
    #[error("expected {expected}, found {found}")]
    Line {
        /// Expected content.
        expected: &'static str,
        /// The line's first characters, quoted.
        found: String,
    },
    /// A field that is not a number.
    #[error("`{column}` is {found}; it must be a decimal number{hint}")]
    Number {
        /// Name of the column.
        column: String,
        /// Text found, quoted.
        found: String,
        /// Advice, or empty.
        hint: String,
    },
    /// An incomplete pose.
    #[error(
        "`{column}` is {found}, but other numbers of the pose are there; in a row without a pose all seven are empty or NaN, or `status` is invalid"
    )]
    Part {
        /// The first column without a number.
        column: String,
        /// Text found, quoted.
        found: String,
    },
    /// Numbers that are not a pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Fields that are separated by spaces.
    #[error("spaces separate the fields of {found}; separate fields by commas, semicolons or tabs")]
    Spaces {
        /// The line's first characters, quoted.
        found: String,
    },
    /// A quote that is not closed, or text after a closed one.
    #[error("a quote is not closed before the end of its field; double a quote that belongs to a name")]
    Quote,
    /// Lines that end in a carriage return only.
    #[error("the lines end in carriage returns only (old Mac text); save the table with line feeds")]
    CarriageReturns,
    /// An unknown status.
    #[error("`status` is {found}; it must be ok, invalid or empty")]
    Status {
        /// Text found, quoted.
        found: String,
    },
    /// An unsupported coordinate system of 3D Slicer.
    #[error("the coordinate system is {found}; LPS (or 1) and RAS (or 0) are read: save the markups in one of them")]
    System {
        /// Value found, quoted.
        found: String,
    },
    /// Two coordinate systems of 3D Slicer in one list.
    #[error(
        "the coordinate system is {second} here and {first} above; a list has one for all points: put the points of each into a file of their own"
    )]
    TwoSystems {
        /// The coordinate system that was stated first.
        first: &'static str,
        /// The second, different one.
        second: &'static str,
    },
    /// Two lines of column names of 3D Slicer in one list.
    #[error(
        "`# columns` differs from the columns above: {found}; put the points of each list into a file of their own"
    )]
    TwoHeads {
        /// Column names in the second line, quoted.
        found: String,
    },
    /// A list of 3D Slicer that doesn't state its coordinate system.
    #[error(
        "it doesn't say its coordinate system: add a line `# CoordinateSystem = LPS` (or RAS) above the points, as 3D Slicer had it"
    )]
    NoSystem,
}

/// Columns of a table without a line of column names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Headless {
    /// Names of the columns, in order; the last column may be missing.
    pub(crate) names: &'static [&'static str],
    /// Description of a row, for messages.
    pub(crate) expected: &'static str,
}

/// Reader of the lines of a table.
#[derive(Debug)]
pub struct Reader {
    headless: Option<Headless>,
    separator: Option<char>,
    columns: Vec<Column>,
    /// Number of empty columns that a spreadsheet appended on the right.
    padding: usize,
    /// Whether the table has no column names and its columns are [`Headless::names`].
    is_headless: bool,
    /// The last comment above the first row, which may contain the column names.
    comment: Option<String>,
    /// Whether the lines are a list of 3D Slicer (.fcsv).
    is_fcsv: bool,
    system: Option<System>,
    is_first: bool,
}

impl Reader {
    /// Reader of a table; if `headless` is `None`, the table needs a line of column names.
    pub fn new(headless: Option<Headless>) -> Self {
        Self {
            headless,
            separator: None,
            columns: Vec::new(),
            padding: 0,
            is_headless: false,
            comment: None,
            is_fcsv: false,
            system: None,
            is_first: true,
        }
    }

    /// Columns of the table; empty before the first line that is not a comment.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Coordinate system of the points in a list of 3D Slicer; `None` for other tables.
    ///
    /// # Errors
    /// The list doesn't state its coordinate system.
    pub(crate) fn system(&self) -> Result<Option<System>, TableFault> {
        if self.is_fcsv && self.system.is_none() {
            return Err(TableFault::NoSystem);
        }
        Ok(self.system)
    }

    /// Takes a line without its line feed. If it is a row, returns its fields, as many as there are columns; in a list
    /// of 3D Slicer there may be more. `None` for other lines.
    ///
    /// # Errors
    /// Two coordinate systems or lists of columns, a wrong number of fields, fields that are separated by spaces, or a
    /// quote that is not closed.
    pub fn line(&mut self, line: &str) -> Result<Option<Vec<String>>, TableFault> {
        let line = match std::mem::take(&mut self.is_first) {
            true => line.strip_prefix('\u{feff}').unwrap_or(line),
            false => line,
        };
        let line = line.trim_matches([' ', '\r']);
        if line.contains('\r') {
            return Err(TableFault::CarriageReturns);
        }
        if let Some(comment) = line.strip_prefix('#') {
            self.comment(comment.trim())?;
            return Ok(None);
        }
        // Excel declares the separator in a line of its own.
        if let (true, Some(separator)) = (self.columns.is_empty(), line.strip_prefix("sep=")) {
            self.separator = separator.chars().next();
            return Ok(None);
        }
        if line.trim().is_empty() {
            return Ok(None);
        }
        let separator = *self.separator.get_or_insert_with(|| split::separator(line));
        let fields = split::split(line, separator)?;
        if fields.iter().all(String::is_empty) {
            return Ok(None);
        }
        if self.columns.is_empty() && self.names(&fields, line)? {
            return Ok(None);
        }
        self.row(fields, line).map(Some)
    }

    /// Records what a comment states about the table.
    fn comment(&mut self, comment: &str) -> Result<(), TableFault> {
        let setting = comment.split_once('=').map(|(key, value)| (key.trim().to_ascii_lowercase(), value.trim()));
        match setting.as_ref().map(|(key, value)| (key.as_str(), *value)) {
            Some(("coordinatesystem", value)) => {
                let second = System::of(value).ok_or_else(|| TableFault::System { found: quote(value) })?;
                let first = *self.system.get_or_insert(second);
                if first != second {
                    return Err(TableFault::TwoSystems { first: first.name(), second: second.name() });
                }
            }
            Some(("columns", names)) if self.columns.is_empty() || self.is_fcsv => {
                let columns: Vec<Column> = split::split(names, ',')?.iter().map(|name| Column::of(name)).collect();
                if !self.columns.is_empty() && self.columns != columns {
                    return Err(TableFault::TwoHeads { found: quote_line(names) });
                }
                self.columns = columns;
                self.separator = Some(',');
                self.is_fcsv = true;
            }
            Some(("markups fiducial file version", _)) => self.is_fcsv = true,
            _ => self.comment = Some(comment.to_owned()),
        }
        Ok(())
    }

    /// Sets the columns from the first line that is not a comment. Returns whether that line has their names.
    fn names(&mut self, fields: &[String], line: &str) -> Result<bool, TableFault> {
        if let [field] = fields
            && split::has_spaced_fields(field)
        {
            return Err(TableFault::Spaces { found: quote_line(line) });
        }
        let is_head = !fields.iter().any(|field| split::looks_numeric(field));
        if is_head {
            let last = fields.iter().rposition(|name| !name.is_empty()).map_or(0, |at| at + 1);
            self.columns = fields[..last].iter().map(|name| Column::of(name)).collect();
            self.padding = fields.len() - last;
            return Ok(true);
        }
        // Some programs write the column names as a comment; prose may also contain words that could be column names.
        if let (Some(comment), Some(separator)) = (&self.comment, self.separator) {
            // A comment whose quotes are not closed is prose.
            let names = split::split(comment, separator).unwrap_or_default();
            let by_separator: Vec<Column> = names.iter().map(|name| Column::of(name)).collect();
            let by_space: Vec<Column> = comment.split_whitespace().map(Column::of).collect();
            let known = |names: &[Column]| names.iter().filter(|name| name.is_known()).count();
            let is_head = |names: &[Column]| names.len() == fields.len() && 2 * known(names) >= names.len();
            if let Some(names) = [by_separator, by_space].into_iter().find(|names| is_head(names)) {
                self.columns = names;
                return Ok(false);
            }
        }
        if self.is_fcsv {
            self.columns = slicer::COLUMNS.map(Column::of).to_vec();
            return Ok(false);
        }
        let headless = self.headless.ok_or(TableFault::NoHead)?;
        self.columns = headless.names.iter().map(|name| Column::of(name)).collect();
        self.is_headless = true;
        Ok(false)
    }

    /// Checks the number of a row's fields and returns them, one per column.
    fn row(&self, mut fields: Vec<String>, line: &str) -> Result<Vec<String>, TableFault> {
        let columns = self.columns.len();
        if fields.len() == columns + self.padding && fields[columns..].iter().all(String::is_empty) {
            fields.truncate(columns);
        }
        let name_is_last = self.columns.last().is_some_and(|column| column.meaning == Meaning::Name);
        if fields.len() + 1 == columns && name_is_last {
            fields.push(String::new());
        }
        let is_text = |fields: &[String]| !fields.iter().any(|field| split::looks_numeric(field));
        if fields.len() > columns && name_is_last && is_text(&fields[columns - 1..]) {
            // The last column is a name without quotes that contains the separator.
            let name = fields.split_off(columns - 1).join(", ");
            fields.push(name);
        }
        // Without column names, a number where the name should be means that the line has too many numbers.
        let is_too_numeric =
            self.is_headless && name_is_last && fields.last().is_some_and(|name| split::looks_numeric(name));
        let has_status = self.is_fcsv && !self.is_headless && fields.get(columns..).is_some_and(slicer::is_status);
        if has_status || (fields.len() == columns && !is_too_numeric) {
            return Ok(fields);
        }
        if let Some(Headless { expected, .. }) = self.headless.filter(|_| self.is_headless) {
            return Err(TableFault::Line { expected, found: quote_line(line) });
        }
        Err(TableFault::Fields { found: fields.len(), columns, hint: self.hint(&fields) })
    }

    /// Likely cause of a wrong number of fields, with advice, as text to append; may be empty.
    fn hint(&self, fields: &[String]) -> &'static str {
        let columns = self.columns.len();
        if self.separator == Some(',') && fields.len() > columns {
            ": are its numbers written with decimal commas? Write decimal points (0.5 instead of 0,5), and put names that hold a comma in quotes"
        } else if fields.len() == 1 && split::has_spaced_fields(&fields[0]) {
            ": separate fields by commas, semicolons or tabs, not by spaces"
        } else if self.is_fcsv {
            ": without a line `# columns` above them, points of 3D Slicer (.fcsv) have id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"
        } else {
            ""
        }
    }
}

fn quote_line(line: &str) -> String {
    format!("`{}`", line.chars().take(80).collect::<String>().escape_debug())
}
