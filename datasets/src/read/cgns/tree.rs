//! The nodes of a CGNS file, as the library lays them out in HDF5: each node is a group with the
//! attributes `name`, `label` and `type`, and its values are the dataset ` data` in it. A node of
//! type `LK` is a link to a node of this or another file.
//!
//! Source: "CGNS SIDS-to-HDF5 File Mapping Manual", and what the library 3.0 to 4.4 writes.

use super::FORMAT;
use crate::model::Values;
use crate::read::ReadError;
use crate::read::error::{At, BROKEN, Fault};
use crate::read::hdf5::{Data, Hdf5File, Object, from_characters};
use std::cell::RefCell;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// Most links that lead to links.
const MOST_LINKS: usize = 16;

/// The file, and those that its links lead to.
pub(super) struct Tree {
    folder: PathBuf,
    files: RefCell<Vec<(String, Rc<Hdf5File>)>>,
    root: Rc<Hdf5File>,
}

/// A node.
#[derive(Clone)]
pub(super) struct Node {
    file: Rc<Hdf5File>,
    address: u64,
    /// Path for messages, with the name of the file if it is another.
    pub(super) path: String,
    pub(super) name: String,
    pub(super) label: String,
}

impl Tree {
    pub(super) fn open(path: &Path) -> Result<Tree, ReadError> {
        let root = Rc::new(Hdf5File::open(path, FORMAT)?);
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Ok(Tree { folder, files: RefCell::default(), root })
    }

    /// The node that holds all others.
    pub(super) fn root(&self) -> Result<Node, Fault> {
        root_of(&self.root, "")
    }

    /// The nodes below a node, in the order of the file; links are followed.
    pub(super) fn children(&self, node: &Node) -> Result<Vec<Node>, Fault> {
        let mut out = Vec::new();
        for (name, child) in node.object()?.children(&mut Vec::new())? {
            out.extend(self.child(node, &name, &child, 0)?);
        }
        Ok(out)
    }

    /// A node below another; `None` for what belongs to the mapping itself.
    fn child(
        &self,
        parent: &Node,
        name: &str,
        object: &Object<'_>,
        depth: usize,
    ) -> Result<Option<Node>, Fault> {
        if name.starts_with(' ') || object.is_dataset() {
            return Ok(None);
        }
        let label = object.text("label")?.unwrap_or_default();
        let is_link = object.text("type")?.is_some_and(|t| t == "LK");
        let path = format!("{}/{name}", parent.path);
        let (file, address, name) = (parent.file.clone(), object.address, name.to_string());
        let own = Node { file, address, path, name, label };
        Ok(Some(if is_link { self.follow(&own, depth)? } else { own }))
    }

    /// The node that a link leads to, under the name of the link.
    fn follow(&self, link: &Node, depth: usize) -> Result<Node, Fault> {
        let at = || At::Field(format!("the link `{}`", link.path));
        if depth >= MOST_LINKS {
            let what = format!("more than {MOST_LINKS} links that lead to each other");
            return Err(Fault::new(at(), what, BROKEN));
        }
        let object = link.object()?;
        let text = |name: &str| -> Result<String, Fault> {
            object.find(name)?.map_or(Ok(String::new()), |o| characters(&o))
        };
        let (to, file) = (text(" path")?, text(" file")?);
        let mut node = match file.trim() {
            "" => root_of(&link.file, link.file_prefix())?,
            name => {
                let is_plain =
                    |c: Component<'_>| matches!(c, Component::Normal(_) | Component::CurDir);
                if !Path::new(name).components().all(is_plain) {
                    let what = format!("it leads to `{to}` of the file {name}, in another folder");
                    let cure = "copy that file beside this one, and name it in the link without \
                                its folder";
                    return Err(Fault::unsupported(at(), what, cure));
                }
                root_of(&self.other(name, &at)?, name)?
            }
        };
        for step in to.split('/').filter(|s| !s.is_empty()) {
            // By its name: thousands of zones with a link each must not be opened for each.
            let next = match node.object()?.find(step)? {
                Some(object) => self.child(&node, step, &object, depth + 1)?,
                None => None,
            };
            node = next.ok_or_else(|| {
                let what = format!("it leads to `{to}`, but `{}` has no `{step}`", node.path);
                Fault::new(at(), what, BROKEN)
            })?;
        }
        Ok(Node { name: link.name.clone(), ..node })
    }

    /// A file in the same folder; each is opened once.
    fn other(&self, name: &str, at: &dyn Fn() -> At) -> Result<Rc<Hdf5File>, Fault> {
        if let Some((_, open)) = self.files.borrow().iter().find(|f| f.0 == name) {
            return Ok(open.clone());
        }
        let path = self.folder.join(name);
        let opened = Hdf5File::open(&path, FORMAT).map_err(|e| {
            let cure = "put the file that it leads to into the folder of this one";
            Fault::new(at(), e.to_string(), cure)
        })?;
        let opened = Rc::new(opened);
        self.files.borrow_mut().push((name.to_string(), opened.clone()));
        Ok(opened)
    }
}

fn root_of(file: &Rc<Hdf5File>, prefix: &str) -> Result<Node, Fault> {
    let address = file.root()?.address;
    let path = if prefix.is_empty() { String::new() } else { format!("{prefix}:") };
    Ok(Node { file: file.clone(), address, path, name: String::new(), label: String::new() })
}

/// The characters of a dataset, which CGNS stores as bytes.
fn characters(object: &Object<'_>) -> Result<String, Fault> {
    Ok(match object.read()? {
        Data::Texts(t) => t.join(""),
        Data::Numbers(Values::I8(v)) => from_characters(v.iter().map(|&b| b as u8)),
        Data::Numbers(Values::U8(v)) => from_characters(v.iter().copied()),
        _ => return Err(Fault::field(format!("`{}`", object.path), "it holds no text")),
    })
}

impl Node {
    fn object(&self) -> Result<Object<'_>, Fault> {
        self.file.at(self.address, self.path.clone())
    }

    /// The name of the file, if it is not the first.
    fn file_prefix(&self) -> &str {
        self.path.split_once(":/").map_or("", |p| p.0)
    }

    /// A fault of the node.
    pub(super) fn fault(&self, what: impl Into<String>) -> Fault {
        Fault::field(format!("`{}`", self.path), what)
    }

    /// A node of a kind that is not read.
    pub(super) fn unsupported(&self, what: impl Into<String>, cure: &str) -> Fault {
        Fault::unsupported(At::Field(format!("`{}`", self.path)), what, cure)
    }

    fn data(&self) -> Result<Option<Object<'_>>, Fault> {
        // The object is found again by its address, so that it lives as long as the node.
        let found = self.object()?.find(" data")?.map(|d| d.address);
        found.map(|address| self.file.at(address, self.path.clone())).transpose()
    }

    fn needed(&self) -> Result<Object<'_>, Fault> {
        self.data()?.ok_or_else(|| self.fault("it has no values"))
    }

    /// Lengths of the axes of its values, the slowest first; `None` without values.
    pub(super) fn shape(&self) -> Result<Option<Vec<u64>>, Fault> {
        self.data()?.map(|d| d.shape()).transpose()
    }

    /// Whether its values are numbers.
    pub(super) fn is_number(&self) -> Result<bool, Fault> {
        self.needed()?.is_number()
    }

    /// Its numbers.
    pub(super) fn values(&self) -> Result<Values, Fault> {
        self.needed()?.values()
    }

    /// The numbers of a box of its values.
    pub(super) fn values_in(&self, start: &[u64], count: &[u64]) -> Result<Values, Fault> {
        self.needed()?.values_in(start, count)
    }

    /// Its whole numbers.
    pub(super) fn integers(&self) -> Result<Vec<i64>, Fault> {
        Ok(crate::read::vtk_xml::pieces::integers(&self.values()?).collect())
    }

    /// Its numbers in double precision.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, Fault> {
        let values = self.values()?;
        Ok((0..values.len()).map(|i| values.get_f64(i)).collect())
    }

    /// Its text; empty without values.
    pub(super) fn text(&self) -> Result<String, Fault> {
        self.data()?.map_or(Ok(String::new()), |d| characters(&d))
    }

    /// Its texts of 32 characters each, as the SIDS has names and units.
    pub(super) fn texts(&self) -> Result<Vec<String>, Fault> {
        let bytes: Vec<u8> = match self.needed()?.read()? {
            Data::Texts(t) => return Ok(t),
            Data::Numbers(Values::I8(v)) => v.iter().map(|&b| b as u8).collect(),
            Data::Numbers(Values::U8(v)) => v,
            _ => return Err(self.fault("it holds no text")),
        };
        Ok(bytes.chunks(32).map(|t| from_characters(t.iter().copied())).collect())
    }
}
