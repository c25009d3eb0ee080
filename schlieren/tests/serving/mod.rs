//! Starts `schlieren serve`, and sends HTTP over a plain socket, so that the program receives
//! exactly the bytes of the test, valid or not.
#![allow(dead_code, reason = "each test binary uses its part")]

use datasets::model::{DataArray, Dataset, ImageData, Values};
use datasets::write::{VtkOptions, write_vtk};
use glam::DVec3;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Writes a flow with density and temperature: air with a light blob right of and above the middle,
/// in a box of 0.2 x 0.1 x 0.1 m.
pub(crate) fn flow(path: &Path) {
    flow_at(path, 0.03, 1.2);
}

/// [`flow`] with another position of the blob and another density around it.
fn flow_at(path: &Path, blob_x_m: f64, around_kg_m3: f64) {
    let (nx, n) = (41u32, 21u32);
    let mut image = ImageData::new([nx, n, n], DVec3::new(-0.1, -0.05, -0.05), DVec3::splat(5e-3));
    let at = |i: u32, n: u32| (f64::from(i) - 0.5 * f64::from(n - 1)) * 5e-3;
    let blob = |i: u32| {
        let (x, y, z) = (at(i % nx, nx), at(i / nx % n, n), at(i / nx / n, n));
        around_kg_m3
            - 0.3
                * (-((x - blob_x_m).powi(2) + (y - 0.01).powi(2) + z * z)
                    / (2.0 * 0.015f64.powi(2)))
                .exp()
    };
    let values: Vec<f32> = (0..nx * n * n).map(|i| blob(i) as f32).collect();
    let temperature = values.iter().map(|r| 1.2 / r * 293.15).collect();
    image.attributes.point.push(DataArray::new("T", 1, Values::F32(temperature)));
    image.attributes.point.push(DataArray::new("rho", 1, Values::F32(values)));
    write_vtk(path, &Dataset::ImageData(image), VtkOptions::default())
        .expect("the flow is written");
}

/// The running program, which is killed on drop.
pub(crate) struct Server {
    pub(crate) child: Child,
    /// `127.0.0.1:PORT`.
    pub(crate) address: String,
    /// `/TOKEN/`.
    pub(crate) base: String,
    dir: tempfile::TempDir,
}

/// An HTTP response.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) head: String,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|e| panic!("{e}: {} {}", self.head, self.text()))
    }
}

impl Server {
    pub(crate) fn start(options: &[&str]) -> Server {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("flow.vti");
        flow(&path);
        Server::of(&path, dir, options)
    }

    /// The flow with its arrays under other meanings than the density.
    pub(crate) fn start_with(medium: &[&str], options: &[&str]) -> Server {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("flow.vti");
        flow(&path);
        Server::as_medium(&path, dir, medium, options)
    }

    /// A series of four times in which the blob moves to the left. The file of the third is
    /// missing.
    pub(crate) fn start_series(options: &[&str]) -> Server {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        let mut entries = String::new();
        for (i, (x_m, around)) in
            [(0.03, 1.2), (0.0, 1.2), (0.0, 1.2), (-0.03, 1.1)].into_iter().enumerate()
        {
            let name = format!("flow-{i}.vti");
            entries += &format!("<DataSet timestep=\"{}\" file=\"{name}\"/>", 0.5 * i as f64);
            flow_at(&path(&name), x_m, around);
        }
        std::fs::remove_file(path("flow-2.vti")).unwrap();
        let text = format!(
            "<VTKFile type=\"Collection\" \
             version=\"0.1\"><Collection>{entries}</Collection></VTKFile>"
        );
        std::fs::write(path("flow.pvd"), text).unwrap();
        Server::of(&path("flow.pvd"), dir, options)
    }

    fn of(path: &Path, dir: tempfile::TempDir, options: &[&str]) -> Server {
        Server::as_medium(path, dir, &["--density", "rho"], options)
    }

    fn as_medium(path: &Path, dir: tempfile::TempDir, medium: &[&str], options: &[&str]) -> Server {
        let mut child = Command::new(env!("CARGO_BIN_EXE_schlieren"))
            .args(["serve", path.to_str().unwrap(), "--json"])
            .args(medium)
            .args(options)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let answer: Value = serde_json::from_str(&line).expect("the address as JSON");
        let url = answer["url"].as_str().unwrap().strip_prefix("http://").unwrap().to_string();
        let (address, token) = url.split_once('/').unwrap();
        Server { child, address: address.into(), base: format!("/{token}"), dir }
    }

    /// The folder with the flow.
    pub(crate) fn folder(&self) -> &Path {
        self.dir.path()
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}{}", self.address, self.base)
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).expect("the server listens");
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream
    }

    /// Sends bytes unchanged and reads until the server closes the connection.
    pub(crate) fn raw(&self, bytes: &[u8]) -> Option<Answer> {
        let mut stream = self.connect();
        // The server may refuse and close before all is sent.
        let _ = stream.write_all(bytes);
        let mut all = Vec::new();
        let _ = stream.read_to_end(&mut all);
        let end = all.windows(4).position(|w| w == b"\r\n\r\n")?;
        let head = String::from_utf8_lossy(&all[..end]).into_owned();
        let status = head.split(' ').nth(1)?.parse().ok()?;
        Some(Answer { status, head, body: all[end + 4..].to_vec() })
    }

    /// Sends a request below the token.
    pub(crate) fn request(&self, method: &str, path: &str, body: &str) -> Answer {
        let (base, length) = (&self.base, body.len());
        let request = format!(
            "{method} {base}{path} HTTP/1.1\r\nHost: localhost\r\nConnection: \
             close\r\nContent-Length: {length}\r\n\r\n{body}"
        );
        self.raw(request.as_bytes()).unwrap_or_else(|| panic!("{method} {path}: no answer"))
    }

    pub(crate) fn get(&self, path: &str) -> Answer {
        self.request("GET", path, "")
    }

    /// Changes the scene, which must succeed.
    pub(crate) fn change(&self, patch: &Value) -> Value {
        let answer = self.request("POST", "scene", &patch.to_string());
        assert_eq!(answer.status, 200, "{patch}: {}", answer.text());
        answer.json()
    }

    /// Waits for the final frame of the newest scene.
    pub(crate) fn finished(&self) -> DecodedFrame {
        let generation = self.get("state").json()["generation"].as_u64().unwrap();
        let (end, mut after) = (Instant::now() + Duration::from_secs(120), 0);
        while Instant::now() < end {
            let answer = self.get(&format!("frame?after={after}"));
            if answer.status == 204 {
                continue;
            }
            let shown = DecodedFrame::new(&answer.body);
            after = shown.info["serial"].as_u64().unwrap();
            if shown.info["finished"] == true
                && shown.info["generation"].as_u64() >= Some(generation)
            {
                return shown;
            }
        }
        panic!("no finished frame within two minutes");
    }

    pub(crate) fn is_healthy(&self) -> bool {
        self.get("state").status == 200
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A decoded frame.
pub(crate) struct DecodedFrame {
    pub(crate) info: Value,
    pub(crate) rgb: Vec<u8>,
    pub(crate) filter: Vec<u8>,
    pub(crate) light: Vec<f32>,
    /// Colours of deflections.
    pub(crate) legend: Vec<u8>,
}

impl DecodedFrame {
    fn new(bytes: &[u8]) -> DecodedFrame {
        let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
        let info: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
        let size = |key: &str| info[key].as_u64().unwrap() as usize;
        let (n, m) = (3 * size("width") * size("height"), size("filter_pixels").pow(2));
        let rest = &bytes[4 + length..];
        let before = n + 3 * m + 4 * m;
        let legend = |axis: usize| info["legend_size"][axis].as_u64().unwrap() as usize;
        assert_eq!(rest.len(), before + 3 * legend(0) * legend(1), "{info}");
        let light = rest[n + 3 * m..before]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
            .collect();
        let legend = rest[before..].to_vec();
        let (rgb, filter) = (rest[..n].to_vec(), rest[n..n + 3 * m].to_vec());
        DecodedFrame { rgb, filter, light, legend, info }
    }
}

/// Fraction of the bytes that differ by more than 3.
pub(crate) fn changed(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| a.abs_diff(**b) > 3).count() as f64 / a.len() as f64
}
