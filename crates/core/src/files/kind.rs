//! Kinds of files that the program reads, each with its size limit.

/// Kinds of files that are read, each with its size limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// Station file.
    Station,
    /// Names of the labels in a label map.
    Names,
    /// Calibration of tracker, sensor and probe.
    Calibration,
    /// Standard planes of a scene.
    Planes,
    /// glTF scene, or one of its buffers.
    Scene,
    /// Label map or image of a patient.
    Volume,
    /// Mesh of another program.
    Mesh,
    /// Manifest of a generator.
    Manifest,
    /// ONNX model.
    Model,
    /// Array (.npy).
    Array,
    /// Image.
    Image,
    /// Table of points or poses (.csv).
    Table,
    /// Description of a wireless tool.
    ToolDescription,
    /// Recording of a session.
    Recording,
    /// Tracked sequence of another program.
    Sequence,
    /// Header of a data set.
    DatasetHeader,
    /// Rows of a data set.
    DatasetRows,
    /// Results that an earlier run of the program stored.
    Stored,
}

impl FileKind {
    /// Name of the kind with its article, and its size limit, bytes.
    pub(super) const fn limit(self) -> (&'static str, u64) {
        const MIB: u64 = 1 << 20;
        const GIB: u64 = 1 << 30;
        match self {
            Self::Station => ("a station file", MIB),
            Self::Names => ("a table of names", MIB),
            Self::Calibration => ("a calibration", MIB),
            Self::Planes => ("a file of standard planes", 16 * MIB),
            Self::Scene => ("a scene", 2 * GIB),
            Self::Volume => ("a volume", 4 * GIB),
            Self::Mesh => ("a mesh", 2 * GIB),
            Self::Manifest => ("a manifest", MIB),
            Self::Model => ("a model", 2 * GIB),
            Self::Array => ("an array", 256 * MIB),
            Self::Image => ("an image", 256 * MIB),
            Self::Table => ("a table", 256 * MIB),
            Self::ToolDescription => ("a tool description", MIB),
            Self::Recording => ("a recording", 64 * GIB),
            Self::Sequence => ("a sequence", 64 * GIB),
            Self::DatasetHeader => ("a data set's header", 16 * MIB),
            Self::DatasetRows => ("a data set's list of rows", 2 * GIB),
            Self::Stored => ("a stored result", 64 * MIB),
        }
    }
}
