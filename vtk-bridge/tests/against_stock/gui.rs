//! ParaView's own window under an X server: the plugin is loaded from ParaView's list of plugins,
//! and the options of the view's panel change the image.

use crate::capture::{Capture, bright};
use crate::compare::{Limits, faults};
use crate::peers::{find, scripts, skip};
use crate::session::{Launch, Program, With, output, plugin_folder};

/// Runs the script in ParaView's window and returns its images, or the reason why it cannot run
/// here.
fn images() -> Result<[Capture; 4], String> {
    let paraview = find("RTSV_PARAVIEW", &["/usr/bin/paraview"])
        .ok_or("paraview, the program with the window, was not found (set RTSV_PARAVIEW)")?;
    let folder = output("gui");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    // Like a user's list of plugins with "Auto Load" enabled.
    let plugin = plugin_folder()?.join("VtkBridge.so");
    let list = folder.join("plugins.xml");
    let entry = format!(
        "<Plugins><Plugin name=\"VtkBridge\" filename=\"{}\" auto_load=\"1\"/></Plugins>",
        plugin.display()
    );
    std::fs::write(&list, entry).map_err(|e| format!("{}: {e}", list.display()))?;
    let report = folder.join("report.json");
    // `--dr`: without the user's settings.
    let line = format!("exec '{}' --dr \"$@\"", paraview.display());
    let script = format!("--script={}", scripts().join("gui/panel.py").display());
    // `Stock`: no VTK_AUTOLOAD_PATH, only the plugin.
    let launch = Launch::new(Program::ParaView, With::Stock, &line)?
        .args([script])
        .env("PV_PLUGIN_CONFIG_FILE", &list)
        .env("PANEL_OUT", &folder)
        .env("PANEL_MODULES", scripts())
        .env("HOME", &folder)
        .env("RTV_REPORT", &report)
        .env("CAPTURE_BESIDE", &report);
    let outcome = launch.output().expect_success("paraview's window");
    let read = |name| {
        Capture::read(&folder, name).unwrap_or_else(|e| panic!("{name}: {e}\n{}", outcome.stderr))
    };
    Ok(["plain", "shadows", "back", "off"].map(read))
}

#[test]
fn options_of_the_panel_change_what_paraviews_window_shows() {
    let [plain, shadows, back, off] = match images() {
        Ok(images) => images,
        Err(reason) => return skip(&reason),
    };
    let window = plain.facts["kind"].as_str().unwrap_or_default();
    assert!(!window.contains("Offscreen"), "{window} is not the window of a GUI");
    assert!(plain.traced_elements() > 0, "{:?}", plain.report);
    let ratio = |c: &Capture, place| bright(c.at(place)) / bright(plain.at(place));
    let [shadow, lit] = ["shadow", "lit"].map(|place| ratio(&shadows, place));
    assert!(
        shadow < 0.3 && (lit - 1.0).abs() < 0.01,
        "with shadows: {shadow} where one falls, {lit} beside"
    );
    assert!(back.rgb == plain.rgb, "switched off again, the image differs");
    assert_eq!(off.traced_elements(), 0, "without ray tracing everything is OpenGL's");
    assert_eq!(faults(&off, &plain, &Limits::STRICT), Vec::<String>::new());
}
