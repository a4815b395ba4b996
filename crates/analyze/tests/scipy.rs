//! SciPy's answers (tests/data/scipy.json, made by tests/data/make_scipy.py) against ours, to 1e-10.

mod noise;

use analyze::filter::{Band, butter, sosfiltfilt};
use analyze::phase::hilbert;
use analyze::spectrum::{
    Average, Detrend, Mode, Options, Scaling, Taper, chi_square_quantile, coherence, csd, rfft_hz,
    rfft_magnitude, spectrogram, stream::WelchStream, welch,
};
use noise::noise;
use serde_json::Value;

/// The largest difference allowed, relative to the largest value of the vector. Measured: 2e-15 (filters 3e-13).
const AGREEMENT: f64 = 1e-10;

fn vectors() -> Value {
    serde_json::from_str(include_str!("data/scipy.json")).unwrap()
}

fn signals() -> (Vec<f64>, Vec<f64>) {
    let x: Vec<f64> = noise(1000, 1).iter().map(|x| x + 2.0).collect();
    let y = noise(1000, 2)
        .iter()
        .enumerate()
        .map(|(k, y)| y + 0.5 * x[(k + 997) % 1000])
        .collect();
    (x, y)
}

fn floats(v: &Value) -> Vec<f64> {
    v.as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

#[track_caller]
fn check(ours: &[f64], scipy: &Value, what: &str) {
    let scipy = floats(scipy);
    assert_eq!(ours.len(), scipy.len(), "{what}: lengths");
    let scale = scipy
        .iter()
        .fold(0.0f64, |m, x| m.max(x.abs()))
        .max(f64::MIN_POSITIVE);
    for (k, (a, b)) in ours.iter().zip(&scipy).enumerate() {
        assert!(
            (a - b).abs() <= AGREEMENT * scale,
            "{what} [{k}]: ours {a:e}, SciPy {b:e}"
        );
    }
}

/// Our options for SciPy's keyword arguments.
fn options(args: &Value, mut o: Options) -> Options {
    for (key, value) in args.as_object().unwrap() {
        match key.as_str() {
            "nperseg" => o.nperseg = value.as_u64().unwrap() as usize,
            "noverlap" => o.noverlap = Some(value.as_u64().unwrap() as usize),
            "nfft" => o.nfft = Some(value.as_u64().unwrap() as usize),
            "window" => {
                o.window = match value.as_str() {
                    Some("hann") => Taper::Hann,
                    Some("hamming") => Taper::Hamming,
                    Some("blackman") => Taper::Blackman,
                    Some("boxcar") => Taper::Boxcar,
                    _ => Taper::Tukey(value[1].as_f64().unwrap()),
                }
            }
            "detrend" if value == "linear" => o.detrend = Detrend::Linear,
            "detrend" => o.detrend = Detrend::None,
            "scaling" => o.scaling = Scaling::Spectrum,
            "average" => o.average = Average::Median,
            "mode" => {}
            other => panic!("unknown argument {other}"),
        }
    }
    o
}

#[test]
fn welch_is_scipys() {
    let (v, (x, _)) = (vectors(), signals());
    for case in v["welch"].as_array().unwrap() {
        let o = options(&case["args"], Options::default());
        let ours = welch(&x, 30.0, &o).unwrap();
        check(&ours.hz, &case["hz"], "welch hz");
        check(
            &ours.power,
            &case["power"],
            &format!("welch {}", case["args"]),
        );
        if o.average == Average::Mean {
            // The streamed one has to be the same, whatever the batches.
            for batch in [1, 7, 100, 1000] {
                let mut stream = WelchStream::new(30.0, &o).unwrap();
                x.chunks(batch).for_each(|c| stream.push(c));
                let streamed = stream.finish().unwrap();
                check(
                    &streamed.power,
                    &case["power"],
                    &format!("stream {} by {batch}", case["args"]),
                );
                assert_eq!(streamed.degrees_of_freedom, ours.degrees_of_freedom);
            }
        }
    }
}

#[test]
fn csd_is_scipys() {
    let (v, (x, y)) = (vectors(), signals());
    for case in v["csd"].as_array().unwrap() {
        let ours = csd(&x, &y, 30.0, &options(&case["args"], Options::default())).unwrap();
        let (re, im): (Vec<f64>, Vec<f64>) = ours.power.iter().map(|z| (z.re, z.im)).unzip();
        check(&re, &case["re"], "csd re");
        check(&im, &case["im"], "csd im");
    }
}

#[test]
fn coherence_is_scipys() {
    let (v, (x, y)) = (vectors(), signals());
    for case in v["coherence"].as_array().unwrap() {
        let (hz, value) =
            coherence(&x, &y, 30.0, &options(&case["args"], Options::default())).unwrap();
        check(&hz, &case["hz"], "coherence hz");
        check(&value, &case["value"], "coherence");
    }
}

#[test]
fn spectrogram_is_scipys() {
    let (v, (x, _)) = (vectors(), signals());
    for case in v["spectrogram"].as_array().unwrap() {
        let args = &case["args"];
        let nperseg = args["nperseg"].as_u64().unwrap_or(256) as usize;
        let mode = if args["mode"] == "magnitude" {
            Mode::Magnitude
        } else {
            Mode::Psd
        };
        let ours = spectrogram(
            &x,
            30.0,
            &options(args, Options::spectrogram(nperseg)),
            mode,
        )
        .unwrap();
        check(&ours.hz, &case["hz"], "spectrogram hz");
        check(&ours.t_s, &case["t_s"], "spectrogram t_s");
        let rows = case["power"].as_array().unwrap();
        assert_eq!(ours.power.len(), rows.len());
        for (ours, row) in ours.power.iter().zip(rows) {
            check(ours, row, &format!("spectrogram {args}"));
        }
    }
}

#[test]
fn hilbert_is_scipys() {
    let (v, (x, _)) = (vectors(), signals());
    for case in v["hilbert"].as_array().unwrap() {
        let ours = hilbert(&x[..case["n"].as_u64().unwrap() as usize]);
        let (re, im): (Vec<f64>, Vec<f64>) = ours.iter().map(|z| (z.re, z.im)).unzip();
        check(&re, &case["re"], "hilbert re");
        let scale = re.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        for (a, b) in im.iter().zip(floats(&case["im"])) {
            assert!((a - b).abs() <= AGREEMENT * scale, "hilbert im: {a} {b}");
        }
    }
}

#[test]
fn butter_and_sosfiltfilt_are_scipys() {
    let (v, (x, _)) = (vectors(), signals());
    for case in v["sosfiltfilt"].as_array().unwrap() {
        let f = floats(&case["corners_hz"]);
        let band = match case["kind"].as_str().unwrap() {
            "low" => Band::Low(f[0]),
            "high" => Band::High(f[0]),
            "band" => Band::Pass(f[0], f[1]),
            _ => Band::Stop(f[0], f[1]),
        };
        let sections = butter(case["order"].as_u64().unwrap() as usize, band, 30.0).unwrap();
        check(
            &sosfiltfilt(&sections, &x[..400]).unwrap(),
            &case["y"],
            &format!("{band:?} of order {}", case["order"]),
        );
    }
}

#[test]
fn rfft_is_numpys() {
    let (v, (x, _)) = (vectors(), signals());
    check(&rfft_hz(255, 0.033), &v["rfft"]["hz"], "rfft hz");
    check(
        &rfft_magnitude(&x[..255]),
        &v["rfft"]["magnitude"],
        "rfft magnitude",
    );
}

#[test]
fn chi_square_quantiles_are_scipys() {
    for row in vectors()["chi2"].as_array().unwrap() {
        let [p, nu, x] = floats(row)[..] else {
            panic!("three numbers")
        };
        let ours = chi_square_quantile(p, nu);
        assert!(
            (ours / x - 1.0).abs() < AGREEMENT,
            "p = {p}, nu = {nu}: ours {ours}, SciPy {x}"
        );
    }
}

#[test]
fn a_spectrum_says_how_sure_it_is() {
    let (x, _) = signals();
    let s = welch(
        &x,
        30.0,
        &Options {
            nperseg: 200,
            ..Options::default()
        },
    )
    .unwrap();
    assert_eq!(s.segments, 9);
    assert!((s.resolution_hz - 0.15).abs() < 1e-15 && (s.enbw_hz - 0.225).abs() < 1e-12);
    // Hann at half overlap: ρ₁ = 1/36, so nearly 2K.
    assert!((s.degrees_of_freedom - 18.0 / (1.0 + 2.0 * (8.0 / 9.0) / 36.0)).abs() < 1e-3);
    let (low, high) = s.confidence(0.95);
    assert!(low < 1.0 && 1.0 < high);
    // The share of bins of white noise whose band holds the true density (1/12 / (f_s/2)).
    let truth = 1.0 / 12.0 / 15.0;
    let inside = s.power[2..99]
        .iter()
        .filter(|p| **p * low <= truth && truth <= **p * high)
        .count();
    assert!((87..=97).contains(&inside), "{inside} of 97");
}

#[test]
fn bad_arguments_are_refused() {
    let x = [1.0, 2.0, f64::NAN];
    let o = Options::default();
    assert!(welch(&[], 30.0, &o).is_err());
    assert!(welch(&x, 30.0, &o).is_err());
    assert!(welch(&x[..2], 0.0, &o).is_err());
    assert!(
        welch(
            &x[..2],
            30.0,
            &Options {
                noverlap: Some(2),
                ..o
            }
        )
        .is_err()
    );
    assert!(welch(&x[..2], 30.0, &Options { nfft: Some(1), ..o }).is_err());
    assert!(csd(&x[..2], &x[..1], 30.0, &o).is_err());
}
